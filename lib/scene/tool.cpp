#include "scene/tool.h"

#include <system_error>
#include <thread>

#include "base/error.h"
#include "scene/evaluate.h"

using namespace fs;

fs_tool::fs_tool(Ref<LocalScene> scene, std::vector<Vec3> points) : scene_(std::move(scene)), points_(std::move(points)) {
  scene_->attach(reader_);
}

fs_tool::~fs_tool() { scene_->detach(reader_); }

fs_status fs_tool::evaluate(const fs_state& state, fs_response& out) noexcept {
  out = {};
  fs_state checked = state;
  if (const fs_status status = check_state(checked); status != FS_OK) return status;
  reader_.mailbox.fetch();
  const Snapshot& snapshot = *reader_.mailbox.front();
  const std::vector<Vec3>& points = points_.empty() ? snapshot.views.view->points : points_;
  const double time = checked.time != 0 ? checked.time : scene_->now(snapshot.clock);
  out = evaluate_scene(snapshot, ToolState::at(checked, points.data(), points.size(), time, reader_.id));
  return FS_OK;
}

void fs::evaluate_field(LocalScene& scene, const char* name, double time, const Vec3* positions, size_t count,
                        Vec3* forces) {
  parse_finite(time, "time");
  for (size_t i = 0; i < count; ++i) {
    if (!(std::fabs(positions[i].x) <= coordinate_limit && std::fabs(positions[i].y) <= coordinate_limit &&
          std::fabs(positions[i].z) <= coordinate_limit)) {
      fail(FS_ERROR_INVALID, "positions[%zu] is (%g, %g, %g), must be finite and within %g m", i, positions[i].x,
           positions[i].y, positions[i].z, coordinate_limit);
    }
  }
  scene.with_snapshot(name, [&](const Snapshot& snapshot, int64_t slot) {
    const double now = time != 0 ? time : scene.now(snapshot.clock);
    const auto evaluate_object_alone = [&](const Entry& entry, const ToolState& point) {
      Share share;
      const bool is_felt =
          entry.is_present(now) && evaluate_object(*entry.object, entry.motion, entry.start, point, share);
      return is_felt ? share.wrench.force : Vec3{};
    };
    const auto work = [&](size_t begin, size_t end, unsigned reader) {
      const Vec3 origin{0, 0, 0};
      for (size_t i = begin; i < end; ++i) {
        fs_state state{};
        state.pose = {positions[i], identity_quat()};
        ToolState point = ToolState::at(state, &origin, 1, now, reader);
        point.is_any_point = true;
        Vec3 sum{};
        if (slot >= 0) {
          sum = evaluate_object_alone(*snapshot.objects.get(static_cast<uint32_t>(slot)), point);
        } else {
          snapshot.objects.for_each([&](uint32_t, const Entry& entry) { sum += evaluate_object_alone(entry, point); });
        }
        forces[i] = sum;
      }
    };

    constexpr size_t least = 1024;  // positions that are worth a thread
    const size_t thread_count =
        std::max<size_t>(1, std::min<size_t>(std::thread::hardware_concurrency(), count / least));
    std::vector<std::unique_ptr<ReaderId>> readers;
    for (size_t i = 0; i < thread_count; ++i) readers.push_back(std::make_unique<ReaderId>());
    snapshot.objects.for_each([&](uint32_t, const Entry& entry) {
      for (const auto& reader : readers) prepare_curves(*entry.object, reader->get());
    });
    std::vector<std::jthread> threads;
    threads.reserve(thread_count);
    size_t begin = count / thread_count;
    try {
      for (size_t i = 1; i < thread_count; ++i) {
        const size_t end = count * (i + 1) / thread_count;
        threads.emplace_back(work, begin, end, readers[i]->get());
        begin = end;
      }
    } catch (const std::system_error&) {  // no thread to be had: this one does the rest
      work(begin, count, readers[0]->get());
    }
    work(0, count / thread_count, readers[0]->get());
  });
}
