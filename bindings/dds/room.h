// The topics of a room (forceserver.idl).
#pragma once

#include "dds.h"
#include "forceserver.h"

namespace bridge {

struct InRoom {
  static constexpr bool in_room = true;
};
template <>
struct TopicOf<forceserver_ForceObject> : InRoom {
  static constexpr const char* name = "forceserver1/Object";
  static constexpr const dds_topic_descriptor_t& type = forceserver_ForceObject_desc;
  static constexpr Service service = Service::state;
};
template <>
struct TopicOf<forceserver_Shape> : InRoom {
  static constexpr const char* name = "forceserver1/Shape";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Shape_desc;
  static constexpr Service service = Service::state;
};
template <>
struct TopicOf<forceserver_Curve> : InRoom {
  static constexpr const char* name = "forceserver1/Curve";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Curve_desc;
  static constexpr Service service = Service::state;
};
template <>
struct TopicOf<forceserver_Surface> : InRoom {
  static constexpr const char* name = "forceserver1/Surface";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Surface_desc;
  static constexpr Service service = Service::state;
};
template <>
struct TopicOf<forceserver_ClientView> : InRoom {
  static constexpr const char* name = "forceserver1/Client";
  static constexpr const dds_topic_descriptor_t& type = forceserver_ClientView_desc;
  static constexpr Service service = Service::state;
};
template <>
struct TopicOf<forceserver_Status> : InRoom {
  static constexpr const char* name = "forceserver1/Status";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Status_desc;
  static constexpr Service service = Service::state;
};
template <>
struct TopicOf<forceserver_Motions> : InRoom {
  static constexpr const char* name = "forceserver1/Motions";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Motions_desc;
  static constexpr Service service = Service::stream;
};
template <>
struct TopicOf<forceserver_Hand> : InRoom {
  static constexpr const char* name = "forceserver1/Hand";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Hand_desc;
  static constexpr Service service = Service::stream;
};
template <>
struct TopicOf<forceserver_Reports> : InRoom {
  static constexpr const char* name = "forceserver1/Reports";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Reports_desc;
  static constexpr Service service = Service::stream;
};
template <>
struct TopicOf<forceserver_Ping> : InRoom {
  static constexpr const char* name = "forceserver1/Ping";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Ping_desc;
  static constexpr Service service = Service::stream;
};
template <>
struct TopicOf<forceserver_Edit> : InRoom {
  static constexpr const char* name = "forceserver1/Edit";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Edit_desc;
  static constexpr Service service = Service::request;
};
template <>
struct TopicOf<forceserver_Stop> : InRoom {
  static constexpr const char* name = "forceserver1/Stop";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Stop_desc;
  static constexpr Service service = Service::request;
};
template <>
struct TopicOf<forceserver_Answer> : InRoom {
  static constexpr const char* name = "forceserver1/Answer";
  static constexpr const dds_topic_descriptor_t& type = forceserver_Answer_desc;
  static constexpr Service service = Service::request;
};

template <class T>
struct Channel {
  explicit Channel(const Participant& participant) : writer(participant), reader(participant) {}
  Writer<T> writer;
  Reader<T> reader;
};

struct Room {
  explicit Room(const Participant& participant)
      : status(participant), objects(participant), clients(participant), shapes(participant), curves(participant),
        surfaces(participant), motions(participant), hands(participant), reports(participant), pings(participant),
        edits(participant), stops(participant), answers(participant) {}
  Channel<forceserver_Status> status;
  Channel<forceserver_ForceObject> objects;
  Channel<forceserver_ClientView> clients;
  Channel<forceserver_Shape> shapes;
  Channel<forceserver_Curve> curves;
  Channel<forceserver_Surface> surfaces;
  Channel<forceserver_Motions> motions;
  Channel<forceserver_Hand> hands;
  Writer<forceserver_Reports> reports;
  Channel<forceserver_Ping> pings;
  Channel<forceserver_Edit> edits;
  Channel<forceserver_Stop> stops;
  Channel<forceserver_Answer> answers;
};

}  // namespace bridge
