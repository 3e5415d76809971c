#include "dds.h"

#include <chrono>
#include <cstring>
#include <map>
#include <mutex>
#include <stdexcept>

#include "say.h"
#include "security.h"

namespace bridge {
namespace {

// A text between the tags of an XML file.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '&': out += "&amp;"; break;
      case '"': out += "&quot;"; break;
      default: out += c;
    }
  }
  return out;
}

// Cyclone's configuration. It stands alone: what CYCLONEDDS_URI says is for other programs, and might open a network that no option
// of the bridge has opened.
std::string configuration(const Participant::Settings& settings) {
  const bool is_local = settings.network == "lo";
  std::string peers;
  for (const std::string& peer : settings.peers) peers += "<Peer address=\"" + escaped(peer) + "\"/>";
  if (is_local) peers += "<Peer address=\"127.0.0.1\"/>";
  std::string out =
      "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"" + escaped(settings.network) + "\"/></Interfaces>";
  if (is_local) out += "<AllowMulticast>false</AllowMulticast>";
  out += "</General><Discovery>";
  if (!peers.empty()) {
    // Where there are peers, each bridge of a machine has a port that others can work out.
    out += "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>100</MaxAutoParticipantIndex><Peers>" + peers +
           "</Peers>";
  }
  // At its end a writer does not wait for readers that are lost: who wants to wait calls wait_for_readers().
  return out + "</Discovery><Internal><WriterLingerDuration>10 ms</WriterLingerDuration></Internal></Domain></CycloneDDS>";
}

// What Cyclone DDS writes to its log, in words for people where they are known; each sentence at most once a minute.
void tell_of_dds(void*, const dds_log_data_t* data) {
  static std::mutex mutex;
  static std::map<std::string, std::chrono::steady_clock::time_point> told;
  const std::string text(data->message, strnlen(data->message, data->size));
  const std::pair<const char*, const char*> known[] = {
      {"Failed to finalize digest context", "key.pem does not belong to certificate.pem: nobody can meet this site"},
      {"Begin handshake", "somebody whose keys are not of this room is on the network, and is not let in"},
      {"handshake", ""},
      {"not allowed", ""},  // passes by itself
      {"certificate has expired", "the keys have expired, or the clock of this machine is wrong"},
      {"not yet valid", "the keys are not valid yet, or the clock of this machine is wrong"},
  };
  std::string sentence = "DDS says: " + text.substr(0, text.find_last_not_of(" \n") + 1);
  for (const auto& [part, words] : known) {
    if (text.find(part) == std::string::npos) continue;
    if (!*words) return;
    sentence = words;
    break;
  }
  const auto now = std::chrono::steady_clock::now();
  {
    const std::lock_guard lock(mutex);
    auto& last = told[sentence];
    if (last.time_since_epoch().count() != 0 && now - last < std::chrono::minutes(1)) return;
    if (told.size() > 100) told.clear();
    told[sentence] = now;
  }
  complain(sentence);
}

}  // namespace

Entity::Entity(dds_entity_t id, const std::string& what) : id_(id) {
  if (id < 0) throw std::runtime_error("DDS cannot make " + what + ": " + dds_strretcode(id));
}

Qos make_qos() { return Qos(dds_create_qos()); }

Participant::Participant(const Settings& settings) : settings_(settings) {
  dds_set_log_sink(tell_of_dds, nullptr);
  domain_ = Entity(dds_create_domain(settings.domain, configuration(settings).c_str()),
                   "the domain " + std::to_string(settings.domain));
  waitset_ = Entity(dds_create_waitset(domain_.get()), "a waitset");
  woken_ = Entity(dds_create_guardcondition(domain_.get()), "a condition");
  dds_waitset_attach(waitset_.get(), woken_.get(), 0);
  join();
}

void Participant::join_again() {
  for (Entity* const entity : {&open_subscriber_, &open_publisher_, &subscriber_, &publisher_, &participant_}) *entity = {};
  join();
}

void Participant::join() {
  const Qos qos = make_qos();
  if (!settings_.security.empty()) secure(*qos, settings_.security);
  const std::string security = settings_.security.empty() ? "" : " with the keys of " + settings_.security;
  participant_ = Entity(dds_create_participant(settings_.domain, qos.get(), nullptr),
                        "a participant on the interface '" + settings_.network + "'" + security);
  const Qos room = make_qos();
  if (!settings_.partition.empty()) {
    const char* partition = settings_.partition.c_str();
    dds_qset_partition(room.get(), 1, &partition);
  }
  publisher_ = Entity(dds_create_publisher(get(), room.get(), nullptr), "a publisher");
  subscriber_ = Entity(dds_create_subscriber(get(), room.get(), nullptr), "a subscriber");
  open_publisher_ = Entity(dds_create_publisher(get(), nullptr, nullptr), "a publisher");
  open_subscriber_ = Entity(dds_create_subscriber(get(), nullptr, nullptr), "a subscriber");
}

Qos Participant::qos_of(Service service, bool is_reader) const {
  Qos qos = make_qos();
  const bool is_stream = service == Service::stream;
  // A writer whose readers are too far behind says so at once: it waits for nobody.
  dds_qset_reliability(qos.get(), is_stream ? DDS_RELIABILITY_BEST_EFFORT : DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos.get(), service == Service::state ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  if (service == Service::request) {
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_ALL, 0);
  } else {
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, service == Service::ros ? 10 : 1);
  }
  if (service == Service::state && !is_reader) {
    dds_qset_liveliness(qos.get(), DDS_LIVELINESS_AUTOMATIC, static_cast<dds_duration_t>(settings_.lease * 1e9));
  }
  // The end of a writer is no removal: what was its is kept until the lease is over, in case it comes back.
  if (!is_reader) dds_qset_writer_data_lifecycle(qos.get(), false);
  if (is_reader) dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
  return qos;
}

Entity Participant::make_topic(const std::string& name, const dds_topic_descriptor_t& type) const {
  return Entity(dds_create_topic(get(), &type, name.c_str(), nullptr, nullptr), "the topic " + name);
}

Entity Participant::make_writer(const std::string& topic, const dds_topic_descriptor_t& type, Service service,
                                bool in_room) const {
  const Entity made = make_topic(topic, type);
  const Qos qos = qos_of(service, false);
  const Entity& publisher = in_room ? publisher_ : open_publisher_;
  return Entity(dds_create_writer(publisher.get(), made.get(), qos.get(), nullptr), "a writer of " + topic);
}

Entity Participant::make_reader(const std::string& topic, const dds_topic_descriptor_t& type, Service service,
                                bool in_room) const {
  const Entity made = make_topic(topic, type);
  const Qos qos = qos_of(service, true);
  const Entity& subscriber = in_room ? subscriber_ : open_subscriber_;
  Entity reader(dds_create_reader(subscriber.get(), made.get(), qos.get(), nullptr), "a reader of " + topic);
  dds_set_status_mask(reader.get(), DDS_DATA_AVAILABLE_STATUS);
  dds_waitset_attach(waitset_.get(), reader.get(), 0);
  return reader;
}

void Participant::wait(double seconds) const {
  dds_waitset_wait(waitset_.get(), nullptr, 0, static_cast<dds_duration_t>(seconds * 1e9));
  bool was_woken;
  dds_take_guardcondition(woken_.get(), &was_woken);
}

void Participant::wake() const { dds_set_guardcondition(woken_.get(), true); }

}  // namespace bridge
