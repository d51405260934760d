#include "core/pack/pack.h"
#include <cmath>
#include <algorithm>
namespace planish {
Vec2 ChartPlacement::operator()(const Vec2& p) const {
  const double c = std::cos(angle), s = std::sin(angle);
  return scale * Vec2(c * p.x() - s * p.y(), s * p.x() + c * p.y()) + offset;
}
Packing Pack(const std::vector<PackChart>& charts, const PackOptions&, const Execution&) {
  Packing r; r.charts.resize(charts.size());
  double area=0; std::vector<Vec2> lo,hi;
  for(auto&c:charts){Vec2 l(1e300,1e300),h(-1e300,-1e300);for(auto&p:c.positions){l=l.cwiseMin(p);h=h.cwiseMax(p);}lo.push_back(l);hi.push_back(h);area+=(h-l).prod();}
  double w=std::sqrt(area)*1.1,x=0,y=0,row=0,maxx=0;
  for(size_t i=0;i<charts.size();++i){Vec2 s=hi[i]-lo[i]; if(x>0&&x+s.x()>w){y+=row*1.01;x=0;row=0;} r.charts[i].offset=Vec2(x,y)-lo[i]; x+=s.x()+0.01*w; row=std::max(row,s.y()); maxx=std::max(maxx,x);}
  double m=std::max(maxx,y+row)*1.001; for(auto&c:r.charts){c.scale=1/m;c.offset/=m;} r.scale=1/m; return r;
}
}
