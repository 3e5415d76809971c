#include "server/session.h"

#include <algorithm>

#include "base/clock.h"
#include "base/error.h"
#include "base/text.h"
#include "server/greeting.h"

namespace fs {
namespace {

// With as many as this, the client's socket is not read until some have been applied or done.
constexpr size_t most_parked = 4096;  // changes
constexpr unsigned most_jobs = 16;    // each may hold a descriptor

constexpr size_t many_changes = 256;  // it takes a while to destroy a batch of more

}  // namespace

Session::Session(Host& host, uint64_t id, Descriptor socket, const Peer& peer, fs_status refusal)
    : client_(std::make_shared<Client>(host, id, std::move(socket), peer)), refusal_(refusal), since_(steady_now()) {}

bool Session::is_busy() const noexcept {
  return !is_idle() || client_->names.has_awaited() || !syncs_.is_empty() || !client_->parked.is_empty();
}

void Session::set_asleep(bool is_asleep) noexcept {
  if (client_->outbox) client_->outbox->is_asleep.store(is_asleep);
}

// ------------------------------------------------------------------------------------------------------- what comes in

Task Session::serve() {
  constexpr int most_messages = 64;  // of one client, before all are looked at again
  while (!client_->is_gone) {
    co_await client_->work.pause(Work::State::idle);
    try {
      finish_jobs();
      if (is_retry_due_) co_await retry_parked();
      for (int i = 0; i < most_messages && is_reading_ && !client_->is_gone; ++i) {
        if (i > 0 && client_->host.is_slice_over()) break;
        if (client_->name.empty()) {
          if (receive_greeting()) continue;
          break;
        }
        Message message{};
        if (!receive_next(message)) break;
        if (!handle_at_once(message)) co_await handle(message);
        note_applied();
        regulate();
      }
    } catch (...) {  // it breaks the rules of the wire; or there is no memory or descriptor for it
      client_->drop();
    }
  }
}

// False: there is none, or the client is gone.
bool Session::receive_next(Message& message) {
  const Transfer transfer = receive(client_->socket, client_->host.message_buffer(), last_serial_, client_->sizes, message);
  if (transfer == Transfer::closed) client_->drop();
  if (transfer != Transfer::done) return false;
  client_->host.note_activity();
  last_serial_ = message.serial;
  return true;
}

bool Session::receive_greeting() {
  const std::span<std::byte> bytes = client_->host.message_buffer();
  Descriptor data;
  size_t size;
  bool is_cut;
  const Transfer transfer = receive_message(client_->socket, bytes, size, {&data, 1}, is_cut);
  if (transfer == Transfer::closed) client_->drop();
  if (transfer != Transfer::done) return false;
  client_->host.note_activity();
  if (!greet(*client_, bytes.first(size), refusal_)) client_->drop(0);
  return true;
}

void Session::look_for_greeting() noexcept {
  try {
    receive_greeting();
  } catch (...) {
    client_->drop();
  }
}

// Most messages need no more than a few microseconds, and nothing that may be claimed. False: handle() is needed.
bool Session::handle_at_once(Message& message) {
  using namespace wire;
  ParkedBatches& parked = client_->parked;
  switch (message.type) {
    case type_wake: return true;
    case type_group:
    case type_clear: return false;
    case type_shape:
    case type_curve:
    case type_surface:
      if (!parked.is_empty()) return false;
      take_asset(PackedAsset::of(message.type, message.record, std::move(message.data)));
      return true;
    default: break;
  }
  Claims& claims = client_->host.claims();
  const Change content{message.type, message.record};
  if (message.type >= type_sync) {
    if (!claims.is_empty()) {
      Claim claim(claims, *client_);
      Requests::add_to(claim, content);
      if (!claims.may_begin(claim)) return false;
    }
    requests_.handle({message.serial, content});
    return true;
  }
  ReceivedBatch batch = batch_of(*client_, message);
  if (!is_ready(batch) || parked.holds_up(batch.about)) {
    park(std::move(batch));
  } else if (!batch.is_request) {
    changes_.apply(batch);
  } else if (claims.is_empty()) {
    requests_.handle({batch.serial, batch.changes[0]});
  } else {
    return false;
  }
  return true;
}

Task Session::handle(Message& message) {
  Client& client = *client_;
  if (is_asset(message.type)) {
    PackedAsset packed = PackedAsset::of(message.type, message.record, std::move(message.data));
    const uint64_t id = packed.id();
    if (client.parked.take_forget(id)) {
      while (client.parked.count_next()) co_await client.work.step();
      // It is wanted again before it was forgotten: so it stays, or is made once more where it was refused.
      if (!client.assets.is_refused(id)) co_return;
      client.assets.forget(id);
    }
    take_asset(std::move(packed));
    co_return;
  }
  Claim claim(client.host.claims(), client);
  const Change content{message.type, message.record};
  if (message.type >= wire::type_sync) {
    Requests::add_to(claim, content);
    co_await claim;
    requests_.handle({message.serial, content});
    co_return;
  }
  ReceivedBatch batch;
  if (message.type == wire::type_group) {
    co_await take_apart(client, message, batch);
  } else {
    batch = batch_of(*client_, message);
  }
  if (batch.changes.empty()) co_return;
  if (!is_ready(batch) || client.parked.holds_up(batch.about)) {
    park(std::move(batch));
    co_return;
  }
  claim.is_own = !batch.is_request;
  claim.others = batch.about.owners;
  co_await claim;
  co_await apply(batch);
}

// ---------------------------------------------------------------------------------------- shapes, curves and surfaces

void Session::take_asset(PackedAsset&& packed) {
  Client& client = *client_;
  const ServerSettings& settings = client.host.settings();
  const uint64_t id = packed.id();
  // Where parked changes will forget some, the client is within its rights: regulate stops reading from it instead.
  const bool is_too_much = client.assets.count() >= wire::most_assets(settings.max_objects) && client.parked.is_empty();
  if (is_too_much || !client.assets.begin(id)) throw BadClient{};
  const auto made = std::make_shared<ClientAssets::Upload>();
  try {
    const std::shared_ptr<const void> charge = client.assets.charge(packed, settings.max_bytes);
    const uint64_t bytes = packed.content_bytes();
    // A worker reads, checks and builds it: that may take long.
    auto work = [made, charge, packed = std::make_shared<PackedAsset>(std::move(packed))](StopToken& stop) {
      try {
        Asset asset = unpack(std::move(*packed), stop);
        asset.keep(charge);
        if (asset.shape) asset.shape->build(stop);
        made->asset = std::move(asset);
      } catch (Error& error) {
        made->status = error.status;
        made->text = std::move(error.text);
      } catch (...) {
        made->status = FS_ERROR_MEMORY;
        made->text = "the server has not enough memory for the shape";
      }
    };
    return client.host.start_job(client, bytes, std::move(work), [this, id, made] {
      is_retry_due_ |= finish_asset(id, std::move(*made));
      note_applied();
    });
  } catch (const Error& error) {
    made->status = error.status;
    made->text = error.text;
  }
  is_retry_due_ |= finish_asset(id, std::move(*made));
}

bool Session::finish_asset(uint64_t id, ClientAssets::Upload&& upload) {
  const bool is_refused = upload.status != FS_OK;
  if (client_->assets.finish(id, std::move(upload)) && is_refused) client_->note_news();
  return client_->parked.needs(id) && client_->parked.note_ready();
}

void Session::take_job(std::list<Worker::Job>& done) noexcept {
  done_.splice(done_.end(), done, done.begin());
  client_->host.resume_later(*client_);
}

void Session::finish_jobs() {
  while (!done_.empty() && !client_->is_gone) {
    std::list<Worker::Job> job;
    job.splice(job.end(), done_, done_.begin());
    --client_->jobs;
    job.front().done();
    regulate();
  }
}

// Stops reading from a client with too much queued work, and begins again when it has little.
void Session::regulate() noexcept {
  if (client_->is_gone) return;
  const size_t most_assets = wire::most_assets(client_->host.settings().max_objects);
  const size_t parked = client_->parked.cost();
  const bool has_too_much = !client_->parked.is_empty() && client_->assets.count() >= most_assets;
  const bool is_over = parked >= most_parked || client_->jobs >= most_jobs || has_too_much;
  const bool is_well_below = parked < most_parked / 2 && client_->jobs < most_jobs && !has_too_much;
  if (is_reading_ ? is_over : is_well_below) client_->host.set_reading(*client_, is_reading_ = !is_reading_);
}

// ------------------------------------------------------------------------------------------------------------ batches

bool Session::is_ready(const ReceivedBatch& batch) const {
  const auto& ids = batch.about.ids;
  return batch.about.is_forget ||
         std::none_of(ids.begin(), ids.end(), [this](uint64_t id) { return client_->assets.is_building(id); });
}

void Session::park(ReceivedBatch&& batch) {
  constexpr size_t most_requests = 64;
  if (batch.is_request && client_->parked.requests() >= most_requests) {
    const Error full{FS_ERROR_FULL, "64 changes of this client wait for shapes; try again when these are built"};
    return requests_.refuse({batch.serial, batch.changes[0]}, full);
  }
  for (const Change& change : batch.changes) {
    if (change.type == wire::type_set) client_->note_absent(change.as<wire::Set>(), FS_OBJECT_PENDING);
    if (change.type == wire::type_remove) client_->names.drop_absent(change.name());
    if (change.type == wire::type_clear) client_->names.drop_absents();
  }
  client_->parked.add(std::move(batch));
}

// All that it is about is claimed.
Task Session::apply(ReceivedBatch& batch) {
  if (batch.is_request) {
    requests_.handle({batch.serial, batch.changes[0]});
  } else if (Changes::is_long(batch.changes)) {
    co_await changes_.apply_step_by_step(batch);
    if (batch.changes.size() > many_changes) client_->host.destroy(std::make_shared<ReceivedBatch>(std::move(batch)));
  } else {
    changes_.apply(batch);
  }
}

Task Session::retry_parked() {
  is_retry_due_ = false;
  Claim claim(client_->host.claims(), *client_);
  claim.is_own = true;
  for (const ReceivedBatch& batch : client_->parked.batches()) {
    claim.others.insert(batch.about.owners.begin(), batch.about.owners.end());
    co_await client_->work.step();
  }
  co_await claim;
  std::deque<ReceivedBatch> batches = client_->parked.take_all();
  for (ReceivedBatch& batch : batches) {
    if (is_ready(batch) && !client_->parked.holds_up(batch.about)) {
      co_await apply(batch);
    } else {
      client_->parked.add(std::move(batch));
    }
    co_await client_->work.look();
  }
  // Names that parked changes held up can be told now.
  if (client_->names.has_untold() || client_->is_view_untold) client_->note_news();
  note_applied();
  regulate();
}

void Session::note_applied() noexcept {
  if (client_->outbox && client_->parked.is_empty()) client_->outbox->applied.store(last_serial_, std::memory_order_release);
}

// -------------------------------------------------------------------------------------------------------- each period

void Session::turn(double now) noexcept {
  if (client_->is_gone || client_->name.empty()) return;
  try {
    client_->outbox->heartbeat.store(now, std::memory_order_relaxed);
    are_moves_taken_ = false;
    if (client_->is_claimed) return;
    are_moves_taken_ = client_->moves.begin_turn() && client_->take_moves();
    client_->scene->post();
  } catch (...) {
    client_->drop();
  }
}

void Session::end_turn() noexcept {
  if (client_->is_gone || client_->name.empty() || client_->is_claimed) return;
  try {
    if (is_idle() && !is_retry_due_ && client_->parked.is_retry_due()) {
      is_retry_due_ = true;
      client_->host.resume_later(*client_);
    }
    const uint64_t used = client_->scene->output->used.load(std::memory_order_acquire);
    if (client_->names.has_awaited()) {
      client_->names.take_used(client_->scene->sequence(), used,
                               [this](const std::string& name) { client_->push_event(FS_EVENT_READY, name); });
    }
    if (client_->parked.is_empty() && !syncs_.is_empty()) syncs_.answer(*client_, are_moves_taken_, used);
  } catch (...) {
    client_->drop();
  }
}

void Session::keep_house() noexcept {
  if (client_->is_gone || client_->is_claimed) return;
  if (client_->name.empty()) {
    constexpr double patience = 2;  // s
    if (steady_now() - since_ > patience) client_->drop(0);
    return;
  }
  try {
    for (fs_event event; client_->scene->take_event(event);) client_->push_event(event);
    if (client_->channel->is_bad()) client_->drop(0);
  } catch (...) {
    client_->drop();
  }
}

}  // namespace fs
