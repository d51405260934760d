#include "server/worker/work.h"

#include <cstring>
#include <limits>
#include <new>
#include <optional>
#include <stdexcept>
#include <vector>

#include "core/base/sha256.h"
#include "core/io/draco_codec.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "server/link/in_process_link.h"
#include "server/worker/report.h"
#include "server/worker/worker.h"
#include "tests/server/testing/meshes.h"

namespace planish {
namespace {

using ::testing::SizeIs;

Mesh Tetrahedron() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.faces = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  return mesh;
}

worker::v1::WorkRequest Request(const Mesh& mesh) {
  worker::v1::WorkRequest request;
  request.set_job("jobs/1");
  request.set_draco(*EncodeDraco(mesh));
  return request;
}

worker::v1::WorkResult RunOnce(const worker::v1::WorkRequest& request) {
  return DoWork(request, Interrupter(), [](const v1::Progress&) {});
}

std::string Reason(const worker::v1::WorkResult& result) {
  google::rpc::ErrorInfo info;
  if (result.status().details_size() > 0) result.status().details(0).UnpackTo(&info);
  return info.reason();
}

TEST(Work, UnwrapsADisc) {
  worker::v1::WorkRequest request = Request(Bump(12));
  request.mutable_options()->set_seams(v1::SEAMS_NONE);
  std::vector<v1::Progress> progress;
  const worker::v1::WorkResult result =
      DoWork(request, Interrupter(), [&](const v1::Progress& p) { progress.push_back(p); });
  ASSERT_EQ(result.status().code(), 0) << result.status().message();

  EXPECT_EQ(result.uv().precision(), v1::PRECISION_FLOAT);
  EXPECT_EQ(result.uv().corner_count(), 3 * 288);
  EXPECT_EQ(result.uv().total_bytes(), 2 * 4 * 3 * 288);
  ASSERT_THAT(result.uv_bytes(), SizeIs(2 * 4 * 3 * 288));
  EXPECT_EQ(result.uv().mesh_sha256(), Sha256(request.draco()));
  EXPECT_EQ(result.uv().uv_sha256(), Sha256(result.uv_bytes()));
  std::vector<float> uv(result.uv_bytes().size() / sizeof(float));
  std::memcpy(uv.data(), result.uv_bytes().data(), result.uv_bytes().size());
  for (const float number : uv) EXPECT_TRUE(number >= 0 && number <= 1) << number;

  const v1::Report& report = result.report();
  EXPECT_EQ(report.input().triangles(), 288);
  EXPECT_EQ(report.input().vertices(), 169);
  ASSERT_EQ(report.charts_size(), 1);
  EXPECT_TRUE(report.charts(0).converged());
  EXPECT_EQ(report.charts(0).method(), "abf");
  EXPECT_NE(report.charts(0).solver(), v1::SOLVER_AUTO);
  EXPECT_NE(report.charts(0).solver(), v1::SOLVER_UNSPECIFIED);
  EXPECT_LE(report.charts(0).residual().wheel(), 1e-8);
  EXPECT_EQ(report.quality().flipped(), 0);
  EXPECT_GT(report.peak_memory_bytes(), 1 << 20);

  ASSERT_GT(progress.size(), 4u);
  EXPECT_EQ(progress.front().stage(), v1::STAGE_DECODE);
  EXPECT_EQ(progress.back().stage(), v1::STAGE_ENCODE);
  int newton_iterations = 0;
  for (std::size_t i = 1; i < progress.size(); ++i) {
    EXPECT_GE(progress[i].stage(), progress[i - 1].stage());
    EXPECT_GE(progress[i].elapsed_seconds(), progress[i - 1].elapsed_seconds());
    EXPECT_EQ(progress[i].tolerance(), 1e-9);
    if (progress[i].newton_iteration() == newton_iterations + 1) ++newton_iterations;
  }
  EXPECT_EQ(newton_iterations, report.charts(0).newton_iterations()) << "every Newton iteration is reported";
}

TEST(Work, ReportsTheBoundary) {
  worker::v1::WorkRequest request = Request(Bump(8));
  request.mutable_options()->set_seams(v1::SEAMS_NONE);
  EXPECT_EQ(RunOnce(request).report().charts(0).boundary().boundary(), v1::BOUNDARY_FREE);
  request.mutable_options()->set_boundary(v1::BOUNDARY_CONVEX);
  const worker::v1::WorkResult result = RunOnce(request);
  const v1::BoundaryReport& boundary = result.report().charts(0).boundary();
  EXPECT_EQ(boundary.boundary(), v1::BOUNDARY_CONVEX);
  EXPECT_EQ(boundary.vertices(), 32);
  EXPECT_GT(boundary.active(), 0);
  EXPECT_GT(boundary.set_changes(), 0);
  EXPECT_TRUE(boundary.settled());
}

TEST(Work, DoubleWhenAskedFor) {
  worker::v1::WorkRequest request = Request(Bump(4));
  request.mutable_options()->set_precision(v1::PRECISION_DOUBLE);
  const worker::v1::WorkResult result = RunOnce(request);
  EXPECT_EQ(result.uv().precision(), v1::PRECISION_DOUBLE);
  EXPECT_EQ(result.uv_bytes().size(), 2u * 8 * 3 * 32);
}

TEST(Work, SameBytesEveryTime) {
  const worker::v1::WorkRequest request = Request(Bump(8));
  EXPECT_EQ(RunOnce(request).uv_bytes(), RunOnce(request).uv_bytes());
}

TEST(Work, ThreadsAreThoseAskedForWithinTheLimitAndChangeNothing) {
  worker::v1::WorkRequest request = Request(Bump(20));
  const worker::v1::WorkResult alone = RunOnce(request);
  EXPECT_EQ(alone.report().threads(), 1);
  request.set_max_threads(3);
  const worker::v1::WorkResult all = RunOnce(request);
  EXPECT_EQ(all.report().threads(), 3);
  EXPECT_EQ(all.uv_bytes(), alone.uv_bytes());
  request.mutable_options()->set_threads(2);
  EXPECT_EQ(RunOnce(request).report().threads(), 2);
  request.mutable_options()->set_threads(200);
  EXPECT_EQ(RunOnce(request).report().threads(), 3);
}

TEST(Work, FaultsAreNamed) {
  worker::v1::WorkRequest request = Request(Tetrahedron());
  request.mutable_options()->set_seams(v1::SEAMS_NONE);
  EXPECT_EQ(Reason(RunOnce(request)), "MESH_CLOSED");

  request = Request(Bump(4));
  request.mutable_options()->set_tolerance(-1);
  EXPECT_EQ(Reason(RunOnce(request)), "OPTIONS_INVALID");

  request = Request(Bump(4));
  request.mutable_draco()->resize(request.draco().size() / 2);
  const worker::v1::WorkResult truncated = RunOnce(request);
  EXPECT_EQ(truncated.status().code(), static_cast<int>(absl::StatusCode::kInvalidArgument));
  EXPECT_EQ(Reason(truncated), "MESH_DECODE_FAILED");
  EXPECT_FALSE(truncated.has_uv());

  request.set_draco("not a mesh at all");
  EXPECT_EQ(Reason(RunOnce(request)), "MESH_DECODE_FAILED");

  Mesh mesh = Bump(4);
  mesh.positions[7].z() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(Reason(RunOnce(Request(mesh))), "MESH_POSITION_NOT_FINITE");
}

TEST(Work, SeamCornersBeyondTheMeshAreRefusedByNumber) {
  worker::v1::WorkRequest request = Request(Bump(4));  // 32 faces
  request.add_seam_corners(95);
  EXPECT_EQ(RunOnce(request).status().code(), 0);
  for (const int corner : {96, -1}) {
    request.add_seam_corners(corner);
    const worker::v1::WorkResult result = RunOnce(request);
    EXPECT_EQ(result.status().code(), static_cast<int>(absl::StatusCode::kInvalidArgument));
    google::rpc::ErrorInfo info;
    ASSERT_TRUE(result.status().details(0).UnpackTo(&info));
    EXPECT_EQ(info.reason(), "OPTIONS_INVALID");
    EXPECT_EQ(info.metadata().at("field"), "seam_corners");
    EXPECT_EQ(info.metadata().at("corner"), std::to_string(corner));
    request.mutable_seam_corners()->RemoveLast();
    worker::v1::WorkRequest uncut = Request(Bump(4));
    uncut.add_uncut_corners(corner);
    EXPECT_EQ(Reason(RunOnce(uncut)), "OPTIONS_INVALID") << corner;
  }
}

TEST(Work, ReportsTheAtlasThatWasAskedFor) {
  worker::v1::WorkRequest request = Request(Bump(4));
  request.mutable_options()->set_texture_size(512);
  request.mutable_options()->set_padding(7);
  const v1::Atlas atlas = RunOnce(request).report().atlas();
  EXPECT_EQ(atlas.pack(), v1::PACK_ON);
  EXPECT_EQ(atlas.texture_size(), 512);
  EXPECT_EQ(atlas.padding(), 7);
  EXPECT_EQ(atlas.tiles(), 1);
}

// A result of charts with 1, 2, 3, ... triangles.
UnwrapResult ManyCharts(std::size_t count) {
  UnwrapResult result;
  result.charts.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    ChartReport& chart = result.charts[i];
    chart.triangles = static_cast<std::int64_t>(i) + 1;
    chart.stretch_l2 = 1 + 0.001 * static_cast<double>(i % 1000);
    chart.flatten.converged = true;
    chart.flatten.newton_iterations = 3;
    chart.flatten.residual.vertex = 1e-10;
  }
  return result;
}

TEST(Report, DescribesEveryChartOfAThousand) {
  UnwrapResult result = ManyCharts(kMaxChartReports);
  result.charts[7].flatten.residual.wheel = 1e-3;
  result.charts[9].flatten.converged = false;
  const v1::Report report = ToProto(result, Mesh(), {});
  ASSERT_EQ(report.charts_size(), static_cast<int>(kMaxChartReports));
  EXPECT_EQ(report.charts(7).triangles(), 8);
  EXPECT_EQ(report.charts(7).chart(), 7);
  EXPECT_EQ(report.chart_totals().charts(), static_cast<int>(kMaxChartReports));
  EXPECT_EQ(report.chart_totals().not_converged(), 1);
  EXPECT_EQ(report.chart_totals().newton_iterations(), 3 * static_cast<int>(kMaxChartReports));
  EXPECT_EQ(report.chart_totals().residual().wheel(), 1e-3);
  EXPECT_EQ(report.chart_totals().residual().vertex(), 1e-10);
  EXPECT_EQ(report.chart_totals().stretch_l2_max(), 1.999);
}

TEST(Report, OfMoreChartsDescribesTheWorst) {
  UnwrapResult result = ManyCharts(5000);
  result.charts[4000].flatten.converged = false;  // with the least stretch of all
  const v1::Report report = ToProto(result, Mesh(), {});
  ASSERT_EQ(report.charts_size(), static_cast<int>(kMaxChartReports));
  EXPECT_EQ(report.chart_totals().charts(), 5000);
  bool has_unconverged = false;
  for (int i = 0; i < report.charts_size(); ++i) {
    const v1::ChartReport& chart = report.charts(i);
    if (i > 0) {
      EXPECT_GT(chart.chart(), report.charts(i - 1).chart());
    }
    EXPECT_EQ(chart.triangles(), chart.chart() + 1);
    has_unconverged |= !chart.converged();
    EXPECT_TRUE(!chart.converged() || chart.stretch_l2() > 1.79) << chart.stretch_l2();
  }
  EXPECT_TRUE(has_unconverged);
  EXPECT_LT(report.ByteSizeLong(), 1u << 19);
}

TEST(Work, InterruptedWorkIsCancelled) {
  Interrupter interrupter;
  const worker::v1::WorkResult result = DoWork(Request(Bump(12)), interrupter, [&](const v1::Progress& progress) {
    if (progress.newton_iteration() == 1) interrupter.Interrupt();
  });
  EXPECT_EQ(result.status().code(), static_cast<int>(absl::StatusCode::kCancelled));
  EXPECT_TRUE(result.uv_bytes().empty());
}

TEST(Work, ExceptionsBecomeErrors) {
  const auto run = [](auto exception) {
    return DoWork(Request(Bump(4)), Interrupter(), [&](const v1::Progress&) { throw exception; });
  };
  EXPECT_EQ(Reason(run(std::bad_alloc())), "OUT_OF_MEMORY");
  EXPECT_EQ(Reason(run(std::runtime_error("boom"))), "INTERNAL");
}

v1::Progress At(double seconds, int newton_iteration, double linear_residual) {
  v1::Progress progress;
  progress.set_stage(v1::STAGE_SOLVE);
  progress.set_elapsed_seconds(seconds);
  progress.set_newton_iteration(newton_iteration);
  progress.set_linear_residual(linear_residual);
  return progress;
}

TEST(ProgressThrottle, ThinsOutLinearIterationsOnly) {
  ProgressThrottle throttle;
  EXPECT_TRUE(throttle.Pass(At(0.00, 0, 0.5)));
  EXPECT_FALSE(throttle.Pass(At(0.01, 0, 0.4)));
  EXPECT_FALSE(throttle.Pass(At(0.09, 0, 0.3)));
  EXPECT_TRUE(throttle.Pass(At(0.10, 0, 0.2)));
  EXPECT_FALSE(throttle.Pass(At(0.11, 0, 0.1)));
  EXPECT_TRUE(throttle.Pass(At(0.12, 1, 0))) << "a Newton iteration";
  EXPECT_TRUE(throttle.Pass(At(0.13, 2, 0)));
  v1::Progress layout = At(0.14, 2, 0.1);
  layout.set_stage(v1::STAGE_LAYOUT);
  EXPECT_TRUE(throttle.Pass(layout)) << "a new stage";
}

TEST(ProgressThrottle, ManyChartsDoNotMakeManyReports) {
  ProgressThrottle throttle;
  int passed = 0;
  for (int chart = 0; chart < 1000; ++chart) {
    v1::Progress progress = At(0.001 * chart, 3, 0);
    progress.set_chart(chart);
    progress.set_chart_count(1000);
    passed += throttle.Pass(progress) ? 1 : 0;
  }
  EXPECT_GE(passed, 9);
  EXPECT_LE(passed, 11);
}

TEST(PackUv, LittleEndian) {
  EXPECT_EQ(PackUv({1.0, -2.0}, Precision::kFloat), std::string("\x00\x00\x80\x3f\x00\x00\x00\xc0", 8));
  EXPECT_EQ(PackUv({1.0}, Precision::kDouble), std::string("\x00\x00\x00\x00\x00\x00\xf0\x3f", 8));
}

TEST(Sha256, KnownAnswer) {
  EXPECT_EQ(Sha256("abc").substr(0, 4), "\xba\x78\x16\xbf");
  EXPECT_EQ(Sha256("").size(), 32u);
}

class WorkerOnALink : public ::testing::Test {
 protected:
  std::shared_ptr<WorkerLink> link_ = *StartInProcessWorker(RunWorker);
};

TEST_F(WorkerOnALink, AnswersWithEventsAndOneResult) {
  worker::v1::ToWorker message;
  *message.mutable_request() = Request(Bump(6));
  link_->Send(message);
  int events = 0;
  std::optional<worker::v1::FromWorker> answer;
  while ((answer = link_->Receive()) && answer->has_event()) ++events;
  EXPECT_GT(events, 4);
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ(answer->result().status().code(), 0);
  EXPECT_FALSE(link_->Receive().has_value());
}

TEST_F(WorkerOnALink, ObeysACancelRequest) {
  worker::v1::ToWorker message;
  *message.mutable_request() = Request(Bump(120));
  message.mutable_request()->mutable_options()->set_solver(v1::SOLVER_MINRES);
  message.mutable_request()->mutable_options()->set_system(v1::SYSTEM_FULL);
  message.mutable_request()->mutable_options()->set_preconditioner(v1::PRECONDITIONER_NONE);
  link_->Send(message);
  ASSERT_TRUE(link_->Receive()->has_event());
  worker::v1::ToWorker cancel;
  cancel.mutable_cancel();
  link_->Send(cancel);
  std::optional<worker::v1::FromWorker> answer;
  while ((answer = link_->Receive()) && answer->has_event()) {
  }
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ(answer->result().status().code(), static_cast<int>(absl::StatusCode::kCancelled));
}

TEST_F(WorkerOnALink, GivesUpWhenTheServerIsGone) {
  worker::v1::ToWorker message;
  *message.mutable_request() = Request(Bump(120));
  link_->Send(message);
  ASSERT_TRUE(link_->Receive()->has_event());
  link_.reset();  // waits for the worker
}

}  // namespace
}  // namespace planish
