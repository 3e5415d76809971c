// Forces at many positions, for plots.
#include <algorithm>
#include <cmath>
#include <system_error>
#include <thread>

#include "base/error.h"
#include "scene/tool.h"

using namespace fs;

namespace {

// What one thread needs of its own.
struct Worker {
  Ref<Memory> memory = make_ref<Memory>();
  const Snapshot& snapshot;
  Scratches scratches;
  Law::Parsers parsers;  // of the one object that is asked for

  Worker(const Snapshot& the_snapshot, uint32_t row) : snapshot(the_snapshot) {
    if (row != no_row) {
      parsers = find_chunk(snapshot.chunks, row)->row(row % chunk_size).object->law.make_parsers();
      return;
    }
    snapshot.chunks.for_each([&](uint32_t number, const Chunk& chunk) {
      memory->make_room(number * chunk_size);
      for_each_bit(chunk.used, [&](uint32_t i) {
        const Object& object = *chunk.row(i).object;
        if (Scratch::is_needed(object)) scratches.set(number * chunk_size + i, Scratch::of(object), 1);
      });
    });
    memory->absorb(snapshot, 0);
  }

  void work(uint32_t row, double now, const Vec3* positions, size_t begin, size_t end, Vec3* forces) noexcept {
    const ToolPoints origin;
    for (size_t i = begin; i < end; ++i) {
      fs_state state{};
      state.pose = {positions[i], identity_quat()};
      ToolState point = ToolState::at(state, origin, now);
      point.is_any_point = true;
      if (row == no_row) {
        forces[i] = evaluate_near(scratches, *memory, 0, 1, origin, point).wrench.force;
        continue;
      }
      const Chunk& chunk = *find_chunk(snapshot.chunks, row);
      const Row& it = chunk.row(row % chunk_size);
      ObjectForce one;
      const bool is_felt =
          it.is_felt(now) && evaluate_object(*it.object, chunk.motion(row % chunk_size), it.start, point, &parsers, one);
      forces[i] = is_felt ? one.wrench.force : Vec3{};
    }
  }
};

}  // namespace

void fs::evaluate_field(LocalScene& scene, const char* name, double time, const Vec3* positions, size_t count, Vec3* forces) {
  parse_finite(time, "time");
  for (size_t i = 0; i < count; ++i) {
    if (!is_in_range(positions[i])) {
      fail(FS_ERROR_INVALID, "positions[%zu] is (%g, %g, %g), must be finite and within %.9g m", i, positions[i].x,
           positions[i].y, positions[i].z, coordinate_limit);
    }
  }
  scene.readers.with_snapshot(name, [&](const Snapshot& snapshot, uint32_t row) {
    const double now = time != 0 ? time : scene.now(snapshot.clock);
    constexpr size_t least = 1024;  // positions that are worth a thread
    const size_t thread_count = std::max<size_t>(1, std::min<size_t>(std::thread::hardware_concurrency(), count / least));
    std::vector<Worker> workers;
    workers.reserve(thread_count);
    for (size_t i = 0; i < thread_count; ++i) workers.emplace_back(snapshot, row);
    std::vector<std::jthread> threads;
    threads.reserve(thread_count);
    size_t begin = count / thread_count;
    try {
      for (size_t i = 1; i < thread_count; ++i) {
        const size_t end = count * (i + 1) / thread_count;
        threads.emplace_back([&, worker = &workers[i], begin, end] { worker->work(row, now, positions, begin, end, forces); });
        begin = end;
      }
    } catch (const std::system_error&) {  // no thread to be had: this one does the rest
      workers[0].work(row, now, positions, begin, count, forces);
    }
    workers[0].work(row, now, positions, 0, count / thread_count, forces);
  });
}
