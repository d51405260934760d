// What the files of deploy/monitoring ask Prometheus for, and what a scrape has to offer.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace planish {

// Every PromQL expression of an alert rule file, and of a Grafana dashboard.
std::vector<std::string> ExpressionsOfRules(const std::string& path);
std::vector<std::string> ExpressionsOfDashboard(const std::string& path);

// A metric in an expression, with the labels that it is selected by.
struct Selector {
  std::string name;
  std::set<std::string> labels;
};

// Those whose names begin with "planish_".
std::vector<Selector> SelectorsOf(const std::string& expression);

struct Scrape {
  std::map<std::string, std::string> help;   // by metric
  std::map<std::string, std::string> types;  // by metric
  // Names of samples, e.g. with _bucket, and the labels of each.
  std::map<std::string, std::set<std::string>> samples;
  std::map<std::string, double> values;  // by name and labels, as they stand in the text
};

// Of Prometheus's text format. Throws std::runtime_error for a line that is none of it.
Scrape ParseScrape(const std::string& text);

}  // namespace planish
