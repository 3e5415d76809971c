#include "server/greeting.h"

#include <algorithm>
#include <cstring>

#include "base/clock.h"
#include "base/error.h"
#include "base/text.h"
#include "ipc/region.h"
#include "server/clients.h"
#include "transfer/records.h"

namespace fs {
namespace {

bool answer(const Client& client, fs_status status, const std::string& text, std::span<const std::byte> rest = {},
            std::span<const int> descriptors = {}) {
  wire::HelloAnswer out{};
  out.magic = wire::magic;
  out.wire = wire::version;
  out.status = status;
  put_text(out.version, fs_version());
  put_text(out.text, text);
  const std::span<const std::byte> parts[] = {bytes_of(&out, 1), rest};
  return send_message(client.socket, parts, descriptors) == Transfer::done && status == FS_OK;
}

void require_free_name(const Clients& clients, const std::string& name) {
  if (name == "server") fail(FS_ERROR_INVALID, "client_name is 'server', which is the name of the server's own scene");
  const std::shared_ptr<Client> other = clients.find(name);
  if (!other) return;
  if (!other->is_alive()) return other->drop();
  fail(FS_ERROR_EXISTS, "client_name is '%s': a client of that name is connected (process %d)", name.c_str(),
       static_cast<int>(other->peer.process));
}

// Makes the client's shared memory, scene and channel, and sends the welcome.
bool open(Client& client, const std::string& name) {
  const ServerSettings& settings = client.host.settings();
  const Servo& servo = client.host.servo();
  const Descriptor inbox = make_region("forceserver-inbox", Inbox::bytes(settings.max_objects));
  seal_region(inbox, false);
  const Descriptor outbox = make_region("forceserver-outbox", sizeof(Outbox));
  client.inbox_memory = map_region(inbox, Inbox::bytes(settings.max_objects), true);
  const std::shared_ptr<void> memory = map_region(outbox, sizeof(Outbox), true);
  seal_region(outbox, true);
  client.names.open(settings.max_objects);
  client.moves.open(Inbox(client.inbox_memory.get(), settings.max_objects), settings.max_objects);
  // All bytes are 0, which is how an Outbox begins: so no page has to be touched.
  client.outbox = std::shared_ptr<Outbox>(memory, static_cast<Outbox*>(memory.get()));
  client.outbox->heartbeat.store(steady_now());
  client.scene = make_ref<LocalScene>(std::shared_ptr<ServoOutput>(client.outbox, &client.outbox->servo));
  client.scene->hold();
  client.scene->set_capacity(2 * settings.max_objects);  // it may replace all of them while the old ones fade out
  client.channel = client.host.servo().add_channel(client.scene, settings.limits, {name, client.peer.user});
  client.connected = client.scene->now();
  client.name = name;
  client.tell_server(FS_OK, "connected");

  wire::Welcome welcome{};
  welcome.inbox_bytes = Inbox::bytes(settings.max_objects);
  welcome.outbox_bytes = sizeof(Outbox);
  welcome.max_objects = settings.max_objects;
  welcome.is_virtual = servo.clock() == ClockKind::virtual_time;
  welcome.is_locked = settings.is_locked;
  welcome.rate = servo.settings().rate;
  welcome.sizes = own_sizes();
  const int descriptors[] = {inbox.get(), outbox.get()};
  return answer(client, FS_OK, "", bytes_of(&welcome, 1), descriptors);
}

}  // namespace

bool greet(Client& client, std::span<const std::byte> message, fs_status refusal) {
  wire::Hello hello{};
  std::memcpy(&hello, message.data(), std::min(message.size(), sizeof hello));
  if (hello.magic != wire::magic || message.size() < sizeof hello) return false;
  if (refusal == FS_ERROR_DENIED) {
    return answer(client, refusal, "this server lets in its own user only; with all_users it lets in others");
  }
  if (hello.wire != wire::version) {
    return answer(client, FS_ERROR_VERSION, wire_difference(hello.wire, text_of(hello.version), wire::version, fs_version()));
  }
  const std::optional<RecordSizes> common = common_sizes(hello.sizes);
  if (!common) return false;
  client.sizes = *common;
  try {
    const std::string name = parse_name(hello.client, "client_name");
    require_free_name(client.host.clients(), name);
    client.host.clients().drop_dead(client.peer.user);  // what they leave counts to the limit of this one
    client.host.require_room();
    return open(client, name);
  } catch (const Error& error) {
    return answer(client, error.status, error.text);
  }
}

}  // namespace fs
