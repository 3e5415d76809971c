// What the bridge needs of DDS, over the C functions of Cyclone DDS: entities that give themselves back, and errors as exceptions.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <dds/dds.h>

#include "say.h"

namespace bridge {

class Entity {
 public:
  Entity() = default;
  Entity(dds_entity_t id, const std::string& what);  // what: "the topic X", for the sentence. Throws std::runtime_error
  Entity(Entity&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~Entity() {
    if (id_ > 0) dds_delete(id_);
  }
  dds_entity_t get() const noexcept { return id_; }

 private:
  dds_entity_t id_ = 0;
};

struct DeleteQos {
  void operator()(dds_qos_t* qos) const noexcept { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, DeleteQos>;
Qos make_qos();

// How a topic is sent.
enum class Service {
  state,  // RELIABLE, TRANSIENT_LOCAL, KEEP_LAST 1: who comes later gets what is. With a liveliness lease
  stream,  // BEST_EFFORT, KEEP_LAST 1
  request,  // RELIABLE, VOLATILE, KEEP_ALL
  ros,  // RELIABLE, VOLATILE, KEEP_LAST 10: the default of ROS 2
};

// Of a topic's struct: its name, description and service.
template <class T>
struct TopicOf;

// The one participant of this program, in a partition of a domain.
class Participant {
 public:
  struct Settings {
    uint32_t domain = 0;
    std::string partition;  // empty: the default one
    std::string network;  // the name of an interface, such as "eth0"; "lo": this machine only
    std::vector<std::string> peers;  // addresses of machines that multicast does not reach
    std::string security;  // a folder with keys (make-keys); empty: none
    double lease = 1;  // s, liveliness
  };
  explicit Participant(const Settings& settings);  // throws std::runtime_error
  // Leaves the domain and joins it as somebody new. Throws std::runtime_error. Destroy all readers and writers of it first.
  void join_again();

  dds_entity_t get() const noexcept { return participant_.get(); }
  Entity make_writer(const std::string& topic, const dds_topic_descriptor_t& type, Service service, bool in_room = true) const;
  Entity make_reader(const std::string& topic, const dds_topic_descriptor_t& type, Service service, bool in_room = true) const;
  // Waits for a sample, s at most.
  void wait(double seconds) const;
  void wake() const;  // ends the wait; any thread

 private:
  void join();
  Entity make_topic(const std::string& name, const dds_topic_descriptor_t& type) const;
  Qos qos_of(Service service, bool is_reader) const;

  const Settings settings_;
  Entity domain_, waitset_, woken_;  // these stay: another thread may wake
  Entity participant_, publisher_, subscriber_;
  Entity open_publisher_, open_subscriber_;  // of the default partition
};

// Lends a sequence of a sample what a vector holds, for as long as it does.
template <class Sequence, class T>
void lend(Sequence& sequence, std::vector<T>& items) {
  sequence._buffer = items.data();
  sequence._length = sequence._maximum = static_cast<uint32_t>(items.size());
  sequence._release = false;
}

template <class T>
class Writer {
 public:
  explicit Writer(const Participant& participant)
      : writer_(participant.make_writer(TopicOf<T>::name, TopicOf<T>::type, TopicOf<T>::service, TopicOf<T>::in_room)) {}

  // False: it cannot be written now, because readers are too far behind; nothing was done.
  bool write(const T& sample) const { return is_done(dds_write(writer_.get(), &sample)); }
  // Sends the whole sample, not only its key. Then DDS need not keep each name that was ever used for who comes late.
  bool dispose(const T& sample) const {
    if (!is_done(dds_writedispose(writer_.get(), &sample))) return false;
    dds_unregister_instance(writer_.get(), &sample);
    return true;
  }
  // Until all readers that are there have what was written; s at most.
  void wait_for_readers(double seconds) const { dds_wait_for_acks(writer_.get(), static_cast<dds_duration_t>(seconds * 1e9)); }
  bool has_readers() const {
    dds_publication_matched_status_t status{};
    return dds_get_publication_matched_status(writer_.get(), &status) == DDS_RETCODE_OK && status.current_count > 0;
  }

 private:
  // A sample that DDS refuses for good must not hold up those behind it: it is told, and counts as written.
  static bool is_done(dds_return_t code) {
    if (code != DDS_RETCODE_OK && code != DDS_RETCODE_TIMEOUT)
      complain(std::string("DDS refuses a ") + TopicOf<T>::name + ": " + dds_strretcode(code));
    return code != DDS_RETCODE_TIMEOUT;
  }
  Entity writer_;
};

template <class T>
class Reader {
 public:
  explicit Reader(const Participant& participant)
      : reader_(participant.make_reader(TopicOf<T>::name, TopicOf<T>::type, TopicOf<T>::service, TopicOf<T>::in_room)) {}

  // Calls f(sample, info) for each that has come. Where info.valid_data is false only the key is there.
  template <class F>
  void take(F&& f) const {
    constexpr int most = 64;
    for (;;) {
      void* samples[most] = {nullptr};
      dds_sample_info_t infos[most];
      const dds_return_t count = dds_take(reader_.get(), samples, infos, most, most);
      if (count <= 0) return;
      struct Loan {
        ~Loan() { dds_return_loan(reader, samples, count); }
        dds_entity_t reader;
        void** samples;
        dds_return_t count;
      } loan{reader_.get(), samples, count};
      for (int i = 0; i < count; ++i) f(*static_cast<const T*>(samples[i]), infos[i]);
      if (count < most) return;
    }
  }
  // Some writer is there whose lease is over.
  bool has_silent_writers() const {
    dds_liveliness_changed_status_t status{};
    return dds_get_liveliness_changed_status(reader_.get(), &status) == DDS_RETCODE_OK && status.not_alive_count > 0;
  }

 private:
  Entity reader_;
};

}  // namespace bridge
