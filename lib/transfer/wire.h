// The records that a client and a server exchange. Both ends must have the same version of the wire: it changes with every
// record, region and meaning here. What may differ is how much the ends know of the records that grow (sizes.h).
//
// On the socket (SOCK_SEQPACKET) each message is a Header and one record of the type's own; a file descriptor may come
// with it. In shared memory: shared_memory.h. All numbers are those of the machine; no record has padding.
//
// A client's messages are numbered by Header::serial, rising. The changes of a group are one message, so that all of them
// are sent or none. Requests are answered by a Reply of the same serial; changes are not answered: an event tells what was
// refused, and a pull what is there instead.
#pragma once

#include <cstddef>
#include <cstdint>

#include <forceserver/server.h>

#include "transfer/contract.h"

namespace fs::wire {

// ---------------------------------------------------------------------------------------- connecting: never changes

inline constexpr uint64_t magic = 0x3172657673636f66;  // "focsver1"
inline constexpr uint32_t version = 4;

// The sizes of the records that an end knows, in bytes, of those that grow. A later version appends more.
struct Sizes {
  uint32_t object, stats, device;  // Object, fs_servo_stats, fs_device_info
  uint32_t later[13];              // 0: the end does not know that record
};

struct Hello {  // the client's first message. A longer one comes from a later version
  uint64_t magic;
  uint32_t wire;                 // version
  uint32_t reserved;             // 0
  char client[FS_NAME_SIZE];
  char version[16];              // of its library, for the sentence
  Sizes sizes;
};

struct HelloAnswer {  // the server's first; FS_OK: a Welcome follows in it, and two descriptors: inbox, outbox
  uint64_t magic;
  uint32_t wire;                 // version
  int32_t status;                // VERSION: the client's wire has another
  char version[16];              // of the server's library
  char text[256];
};

// ----------------------------------------------------------------------------------------------------- the bounds

// For a client that may have so many objects: the changes of a group; the shapes, curves and surfaces at the server, which are those
// of its objects and of a group on its way.
inline constexpr size_t most_changes(uint32_t max_objects) { return 4 * size_t{max_objects} + 64; }
inline constexpr size_t most_assets(uint32_t max_objects) { return 4 * (most_changes(max_objects) + max_objects); }

// ----------------------------------------------------------------------------------------------------- the records

struct Welcome {
  uint64_t inbox_bytes, outbox_bytes;
  uint32_t max_objects;
  uint16_t is_virtual;           // the servo's clock is that of the ticks
  uint16_t is_locked;            // others' objects cannot be changed
  double rate;                   // Hz, of the servo
  Sizes sizes;
};

enum Type : uint32_t {
  // Changes, of the client's own objects and view. A change, a place and a remove may also be of another client's object:
  // its name says "client/object" then. Where such a one comes alone it is a request: Reply.
  type_shape = 1,    // Shape, and a descriptor: points, then triangles
  type_curve,        // Curve, and for a table a descriptor with its forces
  type_forget,       // Forget
  type_set,          // Set
  type_change,       // Set: of an object that is there, only `parts`
  type_place,        // Place
  type_remove,       // Remove
  type_clear,        // nothing
  type_frame,        // Frame
  type_clutch,       // Clutch
  type_tool,         // Tool
  type_wake,         // nothing: wakes the server, as there is something in the inbox
  type_group,        // Group, then a Header and a record for each change; where these are too long for a message, they
                     // are in a descriptor that comes with it. A forget, clear, accuracy and max_stiffness come alone
  type_bind,         // Bind
  type_accuracy,     // Accuracy
  type_max_stiffness, // MaxStiffness
  type_surface,      // Surface
  type_tool_radius,  // ToolRadius

  // Requests.
  type_sync = 100,   // nothing. Reply when a tick has used all before it; or the status of the first refused change
  type_pull,         // Target: an own object, or empty: the next that the client must be told of. Reply, PullAnswer
  type_get,          // Target. Reply, Object
  type_fetch,        // Fetch. Reply, Shape, Curve or Surface, and the descriptor that goes with it
  type_report,       // Target. Reply, fs_report
  type_reports,      // nothing. Reply, Count, and a descriptor: fs_report, as many
  type_clients,      // nothing. Reply, Count, and a descriptor: fs_client, as many
  type_view,         // Target: a client. Reply, fs_view
  type_stats,        // nothing. Reply, fs_servo_stats
  type_device,       // nothing. Reply, fs_device_info
  type_stop_force,   // nothing. Reply
  type_motions,      // Target: a client; empty: all but the asking one. Reply, Count, and a descriptor: fs_motion, as many
  type_views,        // nothing. Reply, Count, and a descriptor: fs_client_view, as many
  type_record,       // After. Reply, Count, and a descriptor: fs_recorded_tick, as many, at most most_ticks of the oldest
  type_resume_force, // nothing. Reply
  type_motions_since, // Since. Reply, Count, and a descriptor: fs_motion, as many, in any order

  type_reply = 200   // Reply and what it says above
};

struct Header {
  uint32_t type;
  uint32_t reserved;             // 0
  uint64_t serial;               // of a change in a group: 0
};

struct Group {
  uint64_t bytes;                // of its changes with their headers
};

struct Reply {
  int32_t status;
  uint32_t reason;               // ReplyReason
  char text[256];                // fs_last_error of the failure
};

enum ReplyReason : uint32_t {
  reason_none,
  reason_not_offered,            // STATE: the client has to send the shape or curve as its own
};

// Shapes, curves and surfaces are named by numbers that never come twice in a process. In the records of both ends it is the client's
// number, of one that the client has sent in a Shape, Curve or Surface; or, with the bit `of_server`, the server's.
inline constexpr uint64_t of_server = uint64_t{1} << 63;
// An Object and its Profiles are in contract.h. In an Object no default is left: of its times only lifetime may be 0.

inline constexpr uint32_t no_slot = ~0u;

struct Set {
  uint32_t slot;                 // of the inbox: the object is moved through it from now on; no_slot: through none, as
                                 // each of another client's
  uint32_t parts;                // fs_part bits
  Object object;
};

// How an object moves from a time on.
struct Motion {
  fs_pose pose;
  fs_twist twist;
  double time;                   // s
  double horizon;                // s, how long the twist holds
};

// In the Place of another client's object: no twist was given, so it is worked out from how the object has moved.
inline constexpr double unknown_horizon = -1;

struct Place {
  char name[FS_NAME_SIZE];
  Motion motion;
};

struct Remove {
  char name[FS_NAME_SIZE];
};

// The object of this name is moved through this slot from now on.
struct Bind {
  uint32_t slot;
  uint32_t reserved;
  char name[FS_NAME_SIZE];
};

struct Frame {
  fs_frame frame;
};

struct Clutch {
  uint64_t is_held;
};

struct Accuracy {
  double newtons;
};

struct MaxStiffness {
  double stiffness;              // N/m, at the device
};

struct Tool {
  uint64_t count;
  fs_vec3 points[FS_TOOL_POINTS_MAX];
};

struct ToolRadius {
  double radius;                 // m, of each point of the tool
};

struct Shape {
  uint64_t id;
  uint32_t primitive, is_closed; // is_closed: of a polyline
  uint64_t point_count, triangle_count;
};

struct Curve {
  uint64_t id;
  uint64_t count;                // of a table; 0: an expression
  double step;                   // m, of a table
  char expression[256];
};

struct Surface {
  uint64_t id;
  std::byte settings[256];       // fs_surface_settings, as far as its sender knows it; the rest is 0
  uint64_t count;                // of the heights of its texture; 0: none
};

struct Forget {  // a shape, curve or surface that no object of the client uses any more
  uint64_t id;
};

struct Target {
  char name[FS_NAME_SIZE];       // "object", "client/object", or a client
};

struct Since {
  Target client;                 // as in a request for motions
  uint64_t revision;             // the motions are those above it
};

struct Fetch {
  uint64_t id;                   // the server's number, of the last Object or PullAnswer that it sent
};

inline constexpr size_t most_ticks = 2048;  // in one answer: where there are more, it is asked for again

struct After {
  uint64_t number;               // of the last tick that the client has
};

// A list: the descriptor that comes along has so many records.
struct Count {
  uint64_t count;
  uint64_t stride;               // bytes from one record to the next
};

// What the server has, where the client may believe something else: others have changed it, or a change was refused.
enum PulledState : uint32_t {
  pulled_nothing,                // there is nothing that the client does not know
  pulled_present,                // object is what it is now
  pulled_absent,                 // there is no object of its name
  pulled_refused,                // there is none, as it was refused
  pulled_waiting,                // a change of the client's own waits for a shape: its outcome is told later
  pulled_asset,                  // the shape, curve or surface of number object.shape was refused: it has to be sent again
  pulled_view                    // frame, tool and tool_radius
};

struct PullAnswer {
  uint32_t state;                // PulledState
  uint32_t slot;                 // of the object; no_slot: none
  uint64_t news;                 // Outbox::news as far as the client has been told
  Motion motion;                 // of the object: unlike an Object it says how long the twist holds
  Frame frame;
  Tool tool;
  ToolRadius tool_radius;
  Object object;
};

// In a slot of the inbox: written by fs_object_move.
struct Move {
  uint64_t after;                // serial of the change that last set the pose: it counts only after that
  Motion motion;
};

struct NumberedEvent {
  uint64_t number;
  fs_event event;
};

// A record of another size needs another version of the wire; none has padding. Set and PullAnswer are counted without their
// last part, which grows.
static_assert(sizeof(Sizes) == 64 && sizeof(Hello) == 224 && sizeof(HelloAnswer) == 288 && sizeof(Welcome) == 96);
static_assert(sizeof(Header) == 16 && sizeof(Group) == 8 && sizeof(Reply) == 264 && sizeof(Count) == 16);
static_assert(sizeof(Motion) == 120 && sizeof(Move) == 128 && sizeof(Place) == 248 && sizeof(Remove) == 128);
static_assert(sizeof(Bind) == 136 && sizeof(Frame) == 104 && sizeof(Clutch) == 8 && sizeof(Accuracy) == 8);
static_assert(sizeof(MaxStiffness) == 8 && sizeof(Tool) == 776 && sizeof(ToolRadius) == 8 && sizeof(Shape) == 32 &&
              sizeof(Curve) == 280);
static_assert(sizeof(Surface) == 272 && sizeof(fs_surface_settings) <= sizeof(Surface::settings));
static_assert(sizeof(Forget) == 8 && sizeof(Target) == 128 && sizeof(Since) == 136 && sizeof(Fetch) == 8 && sizeof(After) == 8);
static_assert(sizeof(NumberedEvent) == 8 + sizeof(fs_event));
static_assert(sizeof(Set) - sizeof(Object) == 8 && sizeof(PullAnswer) - sizeof(Object) == 1024);

}  // namespace fs::wire
