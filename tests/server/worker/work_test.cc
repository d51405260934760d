#include "server/worker/work.h"

#include <unistd.h>

#include <bit>
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/draco/codec.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "server/link/duration.h"
#include "server/link/in_process_link.h"
#include "server/link/mesh_elements.h"
#include "server/worker/failpoints.h"
#include "server/worker/report.h"
#include "server/worker/worker.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using ::testing::SizeIs;

Mesh Tetrahedron() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.faces = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  return mesh;
}

// A job as it comes over the link.
struct Job {
  worker::v1::WorkRequest request;
  std::vector<BlobPtr> blobs;

  v1::UnwrapOptions& options() { return *request.mutable_options(); }
};

Job JobOf(const std::string& draco) {
  Job job;
  job.request.set_job("jobs/1");
  job.blobs = {*Blob::Copy(draco)};
  return job;
}

Job JobOf(const Mesh& mesh) {
  return JobOf(*EncodeDraco(mesh));
}

void AddCorners(const std::vector<std::int32_t>& seams, const std::vector<std::int32_t>& uncut, Job* job) {
  v1::MeshElements elements;
  elements.set_seam_corners(PackNumbers<std::int32_t>(seams));
  elements.set_uncut_corners(PackNumbers<std::int32_t>(uncut));
  job->blobs.resize(1);
  job->blobs.push_back(*Blob::Copy(elements.SerializeAsString()));
}

WorkOutcome RunOutcome(const Job& job) {
  return DoWork(job.request, job.blobs, {});
}

worker::v1::WorkResult RunOnce(const Job& job) {
  return RunOutcome(job).result;
}

std::string UvOf(const Job& job) {
  return std::string(RunOutcome(job).uv->bytes());
}

std::string Reason(const worker::v1::WorkResult& result) {
  google::rpc::ErrorInfo info;
  if (result.status().details_size() > 0) result.status().details(0).UnpackTo(&info);
  return info.reason();
}

// The same mesh as arrays.
Job ArraysOf(const Mesh& mesh) {
  std::string bytes;
  for (const Vec3& position : mesh.positions) {
    for (const double coordinate : position) {
      const auto number = static_cast<float>(coordinate);
      bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
    }
  }
  for (const Face& face : mesh.faces) bytes.append(reinterpret_cast<const char*>(face.data()), sizeof face);
  Job job = JobOf(bytes);
  job.request.set_array_vertices(mesh.num_vertices());
  return job;
}

TEST(Work, ArraysAreUnwrappedAsTheSameMeshByDraco) {
  Mesh odd = Bump(5);
  odd.faces.push_back(odd.faces[3]);              // a second time
  odd.faces.push_back({7, 7, 9});                 // without area
  std::swap(odd.faces[10][0], odd.faces[10][1]);  // wound the other way round
  odd.positions.emplace_back(9, 9, 9);            // without a face
  for (const Mesh& mesh : {Bump(1), Bump(12), Tetrahedron(), odd}) {
    for (const bool cut : {false, true}) {
      Job arrays = ArraysOf(mesh), draco = JobOf(mesh);
      for (Job* job : {&arrays, &draco}) {
        if (cut) AddCorners({0}, {1}, job);
        job->options().set_seams(v1::SEAMS_AUTO);
      }
      const WorkOutcome of_arrays = RunOutcome(arrays), of_draco = RunOutcome(draco);
      ASSERT_EQ(of_draco.result.status().code(), 0) << of_draco.result.status().message();
      ASSERT_EQ(of_arrays.result.status().code(), 0) << of_arrays.result.status().message();
      EXPECT_EQ(of_arrays.uv->bytes(), of_draco.uv->bytes());
      EXPECT_EQ(of_arrays.result.uv().mesh_sha256(), Sha256(arrays.blobs[0]->bytes()));
      EXPECT_EQ(of_arrays.result.report().input().vertices(), mesh.num_vertices());
      EXPECT_EQ(of_arrays.result.report().warnings_size(), of_draco.result.report().warnings_size());
    }
  }
}

TEST(Work, ArraysThatAreNoMeshSayWhere) {
  const auto error = [](const Mesh& mesh) {
    google::rpc::ErrorInfo info;
    EXPECT_TRUE(RunOnce(ArraysOf(mesh)).status().details(0).UnpackTo(&info));
    return info;
  };
  Mesh mesh = Bump(2);
  mesh.faces[3][1] = 9;
  google::rpc::ErrorInfo info = error(mesh);
  EXPECT_EQ(info.reason(), "MESH_INDEX_OUT_OF_RANGE");
  EXPECT_EQ(info.metadata().at("faces"), "3");
  mesh.faces[3][1] = -1;  // 2^32 - 1 as it travels
  EXPECT_EQ(error(mesh).reason(), "MESH_INDEX_OUT_OF_RANGE");

  mesh = Bump(2);
  mesh.positions[4].y() = std::numeric_limits<double>::quiet_NaN();
  info = error(mesh);
  EXPECT_EQ(info.reason(), "MESH_POSITION_NOT_FINITE");
  EXPECT_EQ(info.metadata().at("vertices"), "4");

  Job wrong = ArraysOf(Bump(2));
  for (const std::int64_t vertices : {std::int64_t{-1}, std::int64_t{1'000}, std::int64_t{1} << 60}) {
    wrong.request.set_array_vertices(vertices);
    EXPECT_EQ(Reason(RunOnce(wrong)), "INTERNAL") << "the server announced other arrays";
  }
  wrong.request.set_array_vertices(static_cast<std::int64_t>(wrong.blobs[0]->bytes().size() / 12));
  EXPECT_EQ(Reason(RunOnce(wrong)), "MESH_EMPTY");

  Job large = ArraysOf(Bump(2));
  large.request.set_max_triangles(7);
  EXPECT_EQ(Reason(RunOnce(large)), "MESH_TOO_LARGE");
}

TEST(Work, UnwrapsADisc) {
  Job job = JobOf(Bump(12));
  job.options().set_seams(v1::SEAMS_NONE);
  std::vector<v1::Progress> progress;
  WorkControl control;
  control.on_progress = [&](const v1::Progress& p) { progress.push_back(p); };
  const WorkOutcome outcome = DoWork(job.request, job.blobs, control);
  const worker::v1::WorkResult& result = outcome.result;
  ASSERT_EQ(result.status().code(), 0) << result.status().message();

  EXPECT_EQ(result.uv().precision(), v1::PRECISION_FLOAT);
  EXPECT_EQ(result.uv().corner_count(), 3 * 288);
  EXPECT_EQ(result.uv().total_bytes(), 2 * 4 * 3 * 288);
  ASSERT_THAT(outcome.uv->bytes(), SizeIs(2 * 4 * 3 * 288));
  EXPECT_EQ(result.uv().mesh_sha256(), Sha256(job.blobs[0]->bytes()));
  EXPECT_EQ(result.uv().uv_sha256(), Sha256(outcome.uv->bytes()));
  std::vector<float> uv(outcome.uv->bytes().size() / sizeof(float));
  std::memcpy(uv.data(), outcome.uv->bytes().data(), outcome.uv->bytes().size());
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
    EXPECT_GE(ToSeconds(progress[i].elapsed()), ToSeconds(progress[i - 1].elapsed()));
    EXPECT_EQ(progress[i].tolerance(), 1e-9);
    if (progress[i].newton_iteration() == newton_iterations + 1) ++newton_iterations;
  }
  EXPECT_EQ(newton_iterations, report.charts(0).newton_iterations()) << "every Newton iteration is reported";
}

TEST(Work, ReportsTheBoundary) {
  Job job = JobOf(Bump(8));
  job.options().set_seams(v1::SEAMS_NONE);
  EXPECT_EQ(RunOnce(job).report().charts(0).boundary().boundary(), v1::BOUNDARY_FREE);
  job.options().set_boundary(v1::BOUNDARY_CONVEX);
  const worker::v1::WorkResult result = RunOnce(job);
  const v1::BoundaryReport& boundary = result.report().charts(0).boundary();
  EXPECT_EQ(boundary.boundary(), v1::BOUNDARY_CONVEX);
  EXPECT_EQ(boundary.vertices(), 32);
  EXPECT_GT(boundary.active(), 0);
  EXPECT_GT(boundary.set_changes(), 0);
  EXPECT_TRUE(boundary.settled());
}

TEST(Work, DoubleWhenAskedFor) {
  Job job = JobOf(Bump(4));
  job.options().set_precision(v1::PRECISION_DOUBLE);
  const WorkOutcome outcome = RunOutcome(job);
  EXPECT_EQ(outcome.result.uv().precision(), v1::PRECISION_DOUBLE);
  EXPECT_EQ(outcome.uv->bytes().size(), 2u * 8 * 3 * 32);
}

TEST(Work, SameBytesEveryTime) {
  const Job job = JobOf(Bump(8));
  EXPECT_EQ(UvOf(job), UvOf(job));
}

TEST(Work, ThreadsAreThoseAskedForWithinTheLimitAndChangeNothing) {
  Job job = JobOf(Bump(20));
  const WorkOutcome alone = RunOutcome(job);
  EXPECT_EQ(alone.result.report().threads(), 1);
  job.request.set_max_threads(3);
  const WorkOutcome all = RunOutcome(job);
  EXPECT_EQ(all.result.report().threads(), 3);
  EXPECT_EQ(all.uv->bytes(), alone.uv->bytes());
  job.options().set_threads(2);
  EXPECT_EQ(RunOnce(job).report().threads(), 2);
  job.options().set_threads(200);
  EXPECT_EQ(RunOnce(job).report().threads(), 3);
}

TEST(Work, FaultsAreNamed) {
  Job job = JobOf(Tetrahedron());
  job.options().set_seams(v1::SEAMS_NONE);
  EXPECT_EQ(Reason(RunOnce(job)), "MESH_CLOSED");

  job = JobOf(Bump(4));
  job.options().set_tolerance(-1);
  EXPECT_EQ(Reason(RunOnce(job)), "OPTIONS_INVALID");

  const std::string draco = *EncodeDraco(Bump(4));
  job = JobOf(draco.substr(0, draco.size() / 2));
  const worker::v1::WorkResult truncated = RunOnce(job);
  EXPECT_EQ(truncated.status().code(), static_cast<int>(absl::StatusCode::kInvalidArgument));
  EXPECT_EQ(Reason(truncated), "MESH_DECODE_FAILED");
  EXPECT_FALSE(truncated.has_uv());

  job = JobOf("not a mesh at all");
  EXPECT_EQ(Reason(RunOnce(job)), "MESH_DECODE_FAILED");

  Mesh mesh = Bump(4);
  mesh.positions[7].z() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(Reason(RunOnce(JobOf(mesh))), "MESH_POSITION_NOT_FINITE");
}

TEST(Work, ReportsTheAtlasThatWasAskedFor) {
  Job job = JobOf(Bump(4));
  job.options().set_texture_size(512);
  job.options().set_padding(7);
  const v1::Atlas atlas = RunOnce(job).report().atlas();
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
    FlattenSummary flatten;
    flatten.converged = true;
    flatten.newton_iterations = 3;
    flatten.residual.vertex = 1e-10;
    flatten.residuals = {1, 1e-2f, 1e-5f, 1e-10f};
    chart.flatten = std::make_shared<const FlattenSummary>(std::move(flatten));
  }
  return result;
}

// Changes the solve of one of them.
template <typename Change>
void ChangeSolve(UnwrapResult* result, std::size_t chart, const Change& change) {
  FlattenSummary flatten = *result->charts[chart].flatten;
  change(&flatten);
  result->charts[chart].flatten = std::make_shared<const FlattenSummary>(std::move(flatten));
}

TEST(Report, DescribesEveryChartOfAThousand) {
  UnwrapResult result = ManyCharts(kMaxChartReports);
  ChangeSolve(&result, 7, [](FlattenSummary* flatten) { flatten->residual.wheel = 1e-3; });
  ChangeSolve(&result, 9, [](FlattenSummary* flatten) {
    flatten->converged = false;
    flatten->residuals = {0.5f, 1e-3f};  // ends early, above the others' last ones
  });
  ChangeSolve(&result, 11, [](FlattenSummary* flatten) { flatten->residuals = {2, 1e-4f, 1e-4f, 1e-4f, 1e-10f}; });
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
  EXPECT_THAT(report.charts(11).newton_residuals(), ::testing::ElementsAre(2, 1e-4f, 1e-4f, 1e-4f, 1e-10f));
  EXPECT_THAT(report.chart_totals().newton_residuals(), ::testing::ElementsAre(2, 1e-2f, 1e-3f, 1e-3f, 1e-3f));
}

TEST(Report, OfMoreChartsDescribesTheWorst) {
  UnwrapResult result = ManyCharts(5000);
  // With the least stretch of all.
  ChangeSolve(&result, 4000, [](FlattenSummary* flatten) { flatten->converged = false; });
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
  WorkControl control;
  control.cancel = &interrupter;
  control.on_progress = [&](const v1::Progress& progress) {
    if (progress.newton_iteration() == 1) interrupter.Interrupt();
  };
  const Job job = JobOf(Bump(12));
  const WorkOutcome outcome = DoWork(job.request, job.blobs, control);
  EXPECT_EQ(outcome.result.status().code(), static_cast<int>(absl::StatusCode::kCancelled));
  EXPECT_EQ(outcome.uv, nullptr);
}

TEST(Work, ExceptionsBecomeErrors) {
  const auto run = [](auto exception) {
    WorkControl control;
    control.on_progress = [&](const v1::Progress&) { throw exception; };
    const Job job = JobOf(Bump(4));
    return DoWork(job.request, job.blobs, control).result;
  };
  EXPECT_EQ(Reason(run(std::bad_alloc())), "OUT_OF_MEMORY");
  EXPECT_EQ(Reason(run(std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again)))),
            "OUT_OF_MEMORY")
      << "a thread that cannot be started";
  EXPECT_EQ(Reason(run(std::runtime_error("boom"))), "INTERNAL");
}

TEST(Work, MoreTrianglesThanAllowedAreRefused) {
  Job job = JobOf(Bump(4));
  job.request.set_max_triangles(32);
  EXPECT_EQ(RunOnce(job).status().code(), 0);
  job.request.set_max_triangles(31);
  const worker::v1::WorkResult result = RunOnce(job);
  EXPECT_EQ(result.status().code(), static_cast<int>(absl::StatusCode::kResourceExhausted));
  EXPECT_EQ(Reason(result), "MESH_TOO_LARGE");
}

TEST(Work, BlobsThatCannotBeReadAreAnError) {
  Job job = JobOf(Bump(4));
  job.blobs.push_back(*Blob::Copy("no elements"));
  EXPECT_EQ(Reason(RunOnce(job)), "INTERNAL");
  job.blobs.clear();
  EXPECT_EQ(Reason(RunOnce(job)), "INTERNAL") << "no mesh";
}

TEST(Work, PointsComeInOrderAndMayEndTheJob) {
  std::vector<std::string> points;
  WorkControl control;
  control.at_point = [&](std::string_view point) {
    points.emplace_back(point);
    return point == "encode" ? MakeError(absl::StatusCode::kInternal, "ENOUGH", "enough") : absl::OkStatus();
  };
  const Job job = JobOf(Bump(4));
  EXPECT_EQ(Reason(DoWork(job.request, job.blobs, control).result), "ENOUGH");
  EXPECT_THAT(points, ::testing::ElementsAre("decode", "solve", "encode"));
}

v1::Progress At(double seconds, int newton_iteration, double linear_residual) {
  v1::Progress progress;
  progress.set_stage(v1::STAGE_SOLVE);
  *progress.mutable_elapsed() = ToDuration(seconds);
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

TEST(PackUv, LittleEndianAndSealed) {
  EXPECT_EQ((*PackUv({1.0, -2.0}, Precision::kFloat))->bytes(), std::string("\x00\x00\x80\x3f\x00\x00\x00\xc0", 8));
  const BlobPtr blob = *PackUv({1.0}, Precision::kDouble);
  EXPECT_EQ(blob->bytes(), std::string("\x00\x00\x00\x00\x00\x00\xf0\x3f", 8));
  EXPECT_TRUE(Blob::MapSealed(Descriptor(dup(blob->descriptor()))).ok());
  EXPECT_EQ((*PackUv({}, Precision::kFloat))->bytes(), "");
}

TEST(Failpoint, OnlyNamesThatExist) {
  EXPECT_EQ(Failpoint::Parse("solve=hang")->action, "hang");
  EXPECT_EQ(Failpoint::Parse("")->point, "");
  for (const char* text : {"solve", "solve=", "=hang", "nowhere=hang", "solve=sing", "solve=hang "}) {
    EXPECT_EQ(ErrorInfoOf(Failpoint::Parse(text).status()).reason, "REQUEST_INVALID") << text;
  }
}

TEST(Sha256, KnownAnswer) {
  EXPECT_EQ(Sha256("abc").substr(0, 4), "\xba\x78\x16\xbf");
  EXPECT_EQ(Sha256("").size(), 32u);
}

class WorkerOnALink : public ::testing::Test {
 protected:
  void SetUp() override { EXPECT_TRUE(Next().has_idle()); }

  void Send(const Job& job) {
    worker::v1::ToWorker message;
    *message.mutable_request() = job.request;
    link_->Send(message, job.blobs);
  }

  // Nothing once the link is closed.
  worker::v1::FromWorker Next() {
    WorkerLink::Received received;
    link_->Receive(absl::InfiniteFuture(), &received);
    blob_ = received.blob;
    return received.message;
  }

  worker::v1::WorkResult Result(int* events = nullptr) {
    worker::v1::FromWorker message = Next();
    for (; message.has_event(); message = Next()) {
      if (events != nullptr) ++*events;
    }
    EXPECT_TRUE(message.has_result());
    return message.result();
  }

  std::shared_ptr<WorkerLink> link_ = *StartInProcessWorker(RunWorker);
  BlobPtr blob_;
};

// Cancelled long before it is through.
Job LongJob() {
  Job job = JobOf(Bump(120));
  job.options().set_solver(v1::SOLVER_MINRES);
  job.options().set_system(v1::SYSTEM_FULL);
  job.options().set_preconditioner(v1::PRECONDITIONER_NONE);
  return job;
}

TEST_F(WorkerOnALink, AnswersWithEventsAndOneResultJobAfterJob) {
  const Job job = JobOf(Bump(6));
  const std::string expected = UvOf(job);
  for (int i = 0; i < 3; ++i) {
    Send(job);
    int events = 0;
    EXPECT_EQ(Result(&events).status().code(), 0);
    EXPECT_EQ(blob_->bytes(), expected);
    EXPECT_GT(events, 4);
    EXPECT_TRUE(Next().has_idle());
  }
}

TEST_F(WorkerOnALink, ObeysACancelRequest) {
  Send(LongJob());
  ASSERT_TRUE(Next().has_event());
  worker::v1::ToWorker cancel;
  cancel.mutable_cancel();
  link_->Send(cancel);
  EXPECT_EQ(Result().status().code(), static_cast<int>(absl::StatusCode::kCancelled));
  EXPECT_TRUE(Next().has_idle());
  link_->Send(cancel);  // too late, and not for the next job
  Send(JobOf(Bump(6)));
  EXPECT_EQ(Result().status().code(), 0);
}

TEST_F(WorkerOnALink, ObeysACancelRequestThatComesWithTheJob) {
  Send(LongJob());
  worker::v1::ToWorker cancel;
  cancel.mutable_cancel();
  link_->Send(cancel);
  EXPECT_EQ(Result().status().code(), static_cast<int>(absl::StatusCode::kCancelled));
}

TEST_F(WorkerOnALink, FailpointsAreNotObeyedUnlessAllowed) {
  Job job = JobOf(Bump(6));
  job.request.set_failpoint("start=abort");
  Send(job);
  EXPECT_EQ(Result().status().code(), 0);
}

TEST_F(WorkerOnALink, GivesUpWhenTheServerIsGone) {
  Send(LongJob());
  ASSERT_TRUE(Next().has_event());
  link_.reset();  // waits for the worker
}

}  // namespace
}  // namespace planish
