#include "server/session.h"

#include <sys/socket.h>

#include <algorithm>
#include <cstring>

#include "base/clock.h"
#include "base/error.h"
#include "base/text.h"
#include "server/greeting.h"
#include "transfer/records.h"

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
  return client_->is_applying || client_->names.has_awaited() || !syncs_.is_empty() ||
         !client_->parked.is_empty();
}

void Session::set_asleep(bool is_asleep) noexcept {
  if (client_->outbox) client_->outbox->is_asleep.store(is_asleep);
}

// ------------------------------------------------------------------------------------------------------- what comes in

bool Session::is_next_apart(const Client* busy, uint64_t round) noexcept {
  if (client_->is_gone || client_->name.empty() || client_->is_applying || round_to_wait_ == round) return false;
  struct {
    wire::Header header;
    wire::Target target;
  } next{};
  const ssize_t size = recv(client_->socket.get(), &next, sizeof next, MSG_PEEK | MSG_DONTWAIT);
  using namespace wire;
  bool is_apart = size >= static_cast<ssize_t>(sizeof next.header);
  switch (next.header.type) {
    case type_group:  // these may be long themselves
    case type_clear:
    case type_reports:  // and these are about all
    case type_motions:
    case type_clients:
    case type_views: is_apart = false; break;
    case type_get:
    case type_report:
    case type_view:
    case type_edit:
    case type_move_other:
    case type_remove_other: {
      const std::string target = text_of(next.target.name);
      if (busy && target.substr(0, target.find('/')) == busy->name) is_apart = false;
      break;
    }
    default: break;
  }
  if (!is_apart) round_to_wait_ = round;
  return is_apart;
}

void Session::receive(int most) noexcept {
  try {
    const std::span<std::byte> buffer = client_->host.message_buffer();
    const double start = steady_now();
    for (int i = 0; i < most && !client_->is_gone && is_reading_; ++i) {
      if (i > 0 && steady_now() - start > slice) return;
      Descriptor data;
      size_t size;
      bool is_cut;
      const Transfer transfer = receive_message(client_->socket, buffer, size, {&data, 1}, is_cut);
      if (transfer == Transfer::again) return;
      if (transfer == Transfer::closed) return client_->drop();
      client_->host.note_activity();
      if (client_->name.empty()) {
        if (!greet(*client_, buffer.first(size), refusal_)) client_->drop(0);
        continue;
      }
      handle(buffer.first(size), std::move(data));
      note_applied();
      regulate();
    }
  } catch (...) {  // it breaks the rules of the wire; or there is no memory or descriptor for it
    client_->drop();
  }
}

// The bytes lie in the buffer of all sessions: what is needed later is copied.
void Session::handle(std::span<const std::byte> bytes, Descriptor&& data) {
  wire::Header header;
  if (bytes.size() < sizeof header) throw BadClient{};
  std::memcpy(&header, bytes.data(), sizeof header);
  bytes = bytes.subspan(sizeof header);
  const bool is_size_good = header.type == wire::type_group ? bytes.size() >= sizeof(wire::Group)
                                                            : record_size(header.type, client_->sizes) == bytes.size();
  if (!is_size_good || header.serial <= last_serial_) throw BadClient{};
  last_serial_ = header.serial;
  const auto type = static_cast<wire::Type>(header.type);
  if (type == wire::type_wake) return;
  if (type == wire::type_shape || type == wire::type_curve) return take_asset(PackedAsset::of(type, bytes, std::move(data)));

  const std::shared_ptr<std::byte[]> memory = std::make_shared_for_overwrite<std::byte[]>(bytes.size());
  std::memcpy(memory.get(), bytes.data(), bytes.size());
  bytes = {memory.get(), bytes.size()};
  if (type == wire::type_group) {
    ReceivedBatch batch = take_apart(bytes, memory, std::move(data));
    batch.serial = header.serial;
    if (!client_->is_gone) submit(std::move(batch));
    return;
  }
  const Change content{type, bytes};
  const bool is_request = type >= wire::type_sync;
  if (is_request && !content.is_foreign()) return requests_.handle({header.serial, content});
  ReceivedBatch batch{header.serial, Batch::Reader::read(type, bytes, memory, client_->sizes), {}, is_request};
  check(batch.changes[0], batch.about);
  submit(std::move(batch));
}

// A group may have many changes: others have their turns meanwhile, and may find that this client is gone.
ReceivedBatch Session::take_apart(std::span<const std::byte> body, std::shared_ptr<const void> memory, Descriptor&& data) {
  ReceivedBatch out;
  Batch::Reader reader(body, std::move(memory), std::move(data), wire::most_changes(client_->host.settings().max_objects),
                       client_->sizes);
  while (!reader.is_done()) {
    const std::optional<Change> change = reader.next();
    if (!change) break;
    check(*change, out.about);
    if (out.about.is_forget) throw BadClient{};  // a forget comes alone
    client_->let_others();
    if (client_->is_gone) return out;
  }
  if (!reader.is_good()) throw BadClient{};
  out.changes = reader.take();
  return out;
}

// Checks the change, and adds what it is about. Throws BadClient.
void Session::check(const Change& change, Subjects& about) const {
  uint32_t slot = wire::no_slot;
  if (change.type == wire::type_set || change.type == wire::type_change) slot = change.as<wire::Set>().slot;
  if (change.type == wire::type_bind) slot = change.as<wire::Bind>().slot;
  if (!client_->names.is_slot(slot) || !about.add(change)) throw BadClient{};
}

// ------------------------------------------------------------------------------------------------- shapes and curves

void Session::take_asset(PackedAsset&& packed) {
  Client& client = *client_;
  const ServerSettings& settings = client.host.settings();
  const uint64_t id = packed.id();
  if (client.parked.needs(id)) {
    const Client::Applying applying(client);
    if (client.parked.take_forget(id, [&] { client.let_others(); })) {
      // It is wanted again before it was forgotten: so it stays, or is made once more where it was refused.
      if (!client.assets.is_refused(id)) return;
      client.assets.forget(id);
    }
  }
  // Where parked changes will forget some, the client is within its rights: regulate stops reading from it instead.
  const bool is_too_much = client.assets.count() >= wire::most_assets(settings.max_objects) && client.parked.is_empty();
  if (is_too_much || !client.assets.begin(id)) throw BadClient{};
  const auto made = std::make_shared<ClientAssets::Upload>();
  try {
    const std::shared_ptr<const void> charge = client.assets.charge(packed, settings.max_bytes);
    const uint64_t bytes = packed.content_bytes();
    // A worker reads, checks and builds it: that may take long.
    auto work = [made, charge, packed = std::make_shared<PackedAsset>(std::move(packed))](Wanted& wanted) {
      try {
        Asset asset = unpack(std::move(*packed), wanted);
        if (asset.shape) {
          asset.shape->keep(charge);
          asset.shape->build(wanted);
        } else {
          asset.curve->keep(charge);
        }
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
      if (finish_asset(id, std::move(*made))) retry_parked();
      note_applied();
    });
  } catch (const Error& error) {
    made->status = error.status;
    made->text = error.text;
  }
  finish_asset(id, std::move(*made));  // another client's work may be under way: parked changes wait for the next turn
}

bool Session::finish_asset(uint64_t id, ClientAssets::Upload&& upload) {
  const bool is_refused = upload.status != FS_OK;
  if (client_->assets.finish(id, std::move(upload)) && is_refused) client_->note_news();
  return client_->parked.needs(id) && client_->parked.note_ready();
}

void Session::finish_job(const std::function<void()>& done) noexcept {
  try {
    done();
  } catch (...) {
    client_->drop();
  }
  --client_->jobs;
  regulate();
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

void Session::submit(ReceivedBatch&& batch) {
  if (is_ready(batch) && !client_->parked.holds_up(batch.about)) return apply(std::move(batch));
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

void Session::apply(ReceivedBatch&& batch) {
  if (batch.is_request) return requests_.handle({batch.serial, batch.changes[0]});
  changes_.apply(batch);
  if (batch.changes.size() > many_changes) client_->host.destroy(std::make_shared<ReceivedBatch>(std::move(batch)));
}

void Session::catch_up() noexcept {
  if (client_->is_gone || !client_->parked.is_retry_due()) return;
  try {
    retry_parked();
    regulate();
  } catch (...) {
    client_->drop();
  }
}

void Session::retry_parked() {
  const Client::Applying applying(*client_);
  for (ReceivedBatch& batch : client_->parked.take_all()) {
    if (is_ready(batch) && !client_->parked.holds_up(batch.about)) {
      apply(std::move(batch));
    } else {
      client_->parked.add(std::move(batch));
    }
    client_->let_others();
  }
  if (client_->names.has_untold() || client_->is_view_untold) client_->note_news();  // names that parked changes held up can be told now
  note_applied();
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
    if (client_->is_applying) return;
    are_moves_taken_ = client_->moves.begin_turn() && client_->take_moves();
    client_->scene->post();
  } catch (...) {
    client_->drop();
  }
}

void Session::end_turn() noexcept {
  if (client_->is_gone || client_->name.empty() || client_->is_applying) return;
  try {
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
  if (client_->is_gone || client_->is_applying) return;
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
