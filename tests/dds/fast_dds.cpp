// Fast DDS, a DDS of another vendor, takes part in a room, and reads and writes topics of ROS 2 as a node would; for
// test_bridge_vendors.cpp, which reads what it prints. The types are those that fastddsgen makes of the bridge's IDL.
//
//   fast_dds DOMAIN ROOM      for a minute
//
// As site "fast" it publishes the springs "rock", which it moves along y to 20 mm, and "mast", of a line and a curve of its own.
// It publishes poses on the topic /goal of ROS, (0.05, 0.01, 0).
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include "forceserverPubSubTypes.h"
#include "ros_messagesPubSubTypes.h"

using namespace eprosima::fastdds::dds;
using namespace forceserver;
using geometry_msgs::msg::dds_::PoseStamped_PubSubType;
using geometry_msgs::msg::dds_::TwistStamped_PubSubType;
using geometry_msgs::msg::dds_::WrenchStamped_PubSubType;
using sensor_msgs::msg::dds_::Joy_PubSubType;

namespace {

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

template <class T>
T* made(T* entity, const char* what) {
  if (entity) return entity;
  std::printf("cannot make %s\n", what);
  std::exit(1);
}

enum class Service { state, stream, request, ros, ros_sensor };

template <class Qos>
Qos with(Qos qos, Service service) {
  const bool is_reliable = service != Service::stream && service != Service::ros_sensor;
  const bool is_ros = service == Service::ros || service == Service::ros_sensor;
  qos.reliability().kind = is_reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind = service == Service::state ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  qos.history().kind = service == Service::request ? KEEP_ALL_HISTORY_QOS : KEEP_LAST_HISTORY_QOS;
  qos.history().depth = is_ros ? 10 : 1;
  return qos;
}

class Program {
 public:
  Program(uint32_t domain, const char* room) {
    DomainParticipantFactory::get_instance()->load_profiles();  // also those of the file that the environment names
    participant_ = made(DomainParticipantFactory::get_instance()->create_participant(domain, PARTICIPANT_QOS_DEFAULT), "a participant");
    PublisherQos publisher;
    SubscriberQos subscriber;
    publisher.partition().push_back(room);
    subscriber.partition().push_back(room);
    publisher_ = made(participant_->create_publisher(publisher), "a publisher");
    subscriber_ = made(participant_->create_subscriber(subscriber), "a subscriber");
    ros_publisher_ = made(participant_->create_publisher(PUBLISHER_QOS_DEFAULT), "a publisher");
    ros_subscriber_ = made(participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT), "a subscriber");
  }
  template <class Type>
  DataWriter* writer(const char* topic, Service service) {
    Publisher* const publisher = service >= Service::ros ? ros_publisher_ : publisher_;
    DataWriterQos qos = with(DATAWRITER_QOS_DEFAULT, service);
    if (service == Service::state) qos.liveliness().lease_duration = {1, 0}, qos.liveliness().announcement_period = {0, 300000000};
    return made(publisher->create_datawriter(topic_of<Type>(topic), qos), topic);
  }
  template <class Type>
  DataReader* reader(const char* topic, Service service) {
    Subscriber* const subscriber = service >= Service::ros ? ros_subscriber_ : subscriber_;
    return made(subscriber->create_datareader(topic_of<Type>(topic), with(DATAREADER_QOS_DEFAULT, service)), topic);
  }

 private:
  template <class Type>
  Topic* topic_of(const char* name) {
    TypeSupport type(new Type());
    type.register_type(participant_);
    return made(participant_->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT), name);
  }
  DomainParticipant* participant_;
  Publisher *publisher_, *ros_publisher_;
  Subscriber *subscriber_, *ros_subscriber_;
};

template <class Sample, class F>
void take(DataReader* reader, F&& f) {
  Sample sample;
  SampleInfo info;
  while (reader->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
    if (info.valid_data) f(sample);
  }
}

ForceObject spring(const char* name, double x, uint64_t session) {
  ForceObject out;
  out.site() = "fast";
  out.client() = "cpp";
  out.name() = name;
  out.session() = session;
  out.revision() = out.change() = 1;
  out.change_size() = 1;
  out.place().position().x() = x;
  out.place().orientation().w() = 1;
  out.front().kind() = 2;  // LINEAR_INCREASING, attractive
  out.front().gain() = 100;
  out.front().limit() = 5;
  out.enabled() = true;
  return out;
}

int run(uint32_t domain, const char* room) {
  Program program(domain, room);
  DataWriter* const objects = program.writer<ForceObjectPubSubType>("forceserver1/Object", Service::state);
  DataWriter* const shapes = program.writer<ShapePubSubType>("forceserver1/Shape", Service::state);
  DataWriter* const curves = program.writer<CurvePubSubType>("forceserver1/Curve", Service::state);
  DataWriter* const motions = program.writer<MotionsPubSubType>("forceserver1/Motions", Service::stream);
  DataReader* const status = program.reader<StatusPubSubType>("forceserver1/Status", Service::state);
  DataReader* const hands = program.reader<HandPubSubType>("forceserver1/Hand", Service::stream);
  DataReader* const reports = program.reader<ReportsPubSubType>("forceserver1/Reports", Service::stream);
  DataWriter* const goal = program.writer<PoseStamped_PubSubType>("rt/goal", Service::ros);
  DataReader* const pose = program.reader<PoseStamped_PubSubType>("rt/forceserver/desk/pose", Service::ros);
  DataReader* const twist = program.reader<TwistStamped_PubSubType>("rt/forceserver/desk/twist", Service::ros);
  DataReader* const wrench = program.reader<WrenchStamped_PubSubType>("rt/forceserver/desk/wrench", Service::ros_sensor);
  DataReader* const buttons = program.reader<Joy_PubSubType>("rt/forceserver/desk/buttons", Service::ros);

  const auto session = static_cast<uint64_t>(now() * 1e9);
  Shape line;
  line.content() = "fast-line";
  line.pieces() = 1;
  line.primitive() = 1;  // POLYLINE
  line.points().resize(2);
  line.points()[0].z() = -0.02;
  line.points()[1].z() = 0.02;
  shapes->write(&line);
  Curve table;
  table.content() = "fast-table";
  table.pieces() = 1;
  table.step() = 0.01;
  table.forces() = {0, 2, 2};
  curves->write(&table);
  ForceObject mast = spring("mast", 0.03, session);
  mast.primitive() = 1;
  mast.form() = line.content();
  mast.front().kind() = 7;  // CUSTOM
  mast.front().gain() = 1;
  mast.front().curve() = table.content();
  objects->write(&mast);
  ForceObject rock = spring("rock", 0.03, session);
  objects->write(&rock);

  for (uint64_t number = 1; number < 1500; ++number) {
    std::this_thread::sleep_for(std::chrono::milliseconds(40));
    Moved moved;
    moved.client() = rock.client();
    moved.name() = rock.name();
    moved.revision() = 1 + number;
    moved.place() = rock.place();
    moved.place().position().y() = 0.001 * static_cast<double>(std::min<uint64_t>(number, 20));
    moved.time() = now();
    Motions sample;
    sample.site() = "fast";
    sample.session() = session;
    sample.number() = number;
    sample.sent() = now();
    sample.moves().push_back(moved);
    motions->write(&sample);
    geometry_msgs::msg::dds_::PoseStamped_ there;
    there.header().frame_id("world");
    there.pose().position().x() = 0.05;
    there.pose().position().y() = 0.01;
    there.pose().orientation().w() = 1;
    goal->write(&there);

    take<Status>(status, [](Status& s) {
      std::printf("status %s %s %.1f\n", s.site().c_str(), s.device().c_str(), s.force_max());
      for (const HeldObjects& held : s.held()) std::printf("holds %s %u\n", held.site().c_str(), held.objects());
    });
    take<Hand>(hands, [](Hand& s) {
      std::printf("hand %s %.4f %.4f\n", s.site().c_str(), s.place().position().x(), s.force().x());
    });
    take<Reports>(reports, [](Reports& s) {
      for (const Report& felt : s.felt()) std::printf("felt %s/%s %.2f\n", felt.client().c_str(), felt.name().c_str(), felt.force().x());
    });
    take<geometry_msgs::msg::dds_::PoseStamped_>(pose, [](auto& s) {
      std::printf("pose %s %.1f %d\n", s.header().frame_id().c_str(), s.pose().orientation().w(),
                  std::abs(s.header().stamp().sec() - std::time(nullptr)) <= 1);
    });
    take<geometry_msgs::msg::dds_::TwistStamped_>(twist, [](auto& s) {
      std::printf("twist %s %.4f\n", s.header().frame_id().c_str(), s.twist().linear().x());
    });
    take<geometry_msgs::msg::dds_::WrenchStamped_>(wrench, [](auto& s) {
      std::printf("wrench %s %.4f\n", s.header().frame_id().c_str(), s.wrench().force().x());
    });
    take<sensor_msgs::msg::dds_::Joy_>(buttons, [](auto& s) {
      std::printf("buttons %s %zu %zu %d\n", s.header().frame_id().c_str(), s.axes().size(), s.buttons().size(), s.buttons()[0]);
    });
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace

int main(int count, char** words) {
  if (count != 3) {
    std::fprintf(stderr, "usage: fast_dds DOMAIN ROOM\n");
    return 2;
  }
  return run(static_cast<uint32_t>(std::atoi(words[1])), words[2]);
}
