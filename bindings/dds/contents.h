// What objects share, on its way between sites: shapes, curves and surfaces, each named by a hash of its content.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "room.h"
#include "samples.h"
#include "worker.h"

namespace bridge {

struct Content {
  std::string key;
  // One of them:
  forceserver::Shape shape;
  forceserver::Curve curve;
  forceserver::Surface surface;
};
using ContentRef = std::shared_ptr<const Content>;

// The content of a handle, null: null. It takes a reference to the handle. May take long.
ContentRef content_of(fs_shape* shape);
ContentRef content_of(fs_curve* curve);
ContentRef content_of(fs_surface* surface);

// Puts the keys of an object's contents into its sample; an object of the sample's contents gets the handles.
struct ContentsOfObject {
  ContentRef shape, surface, front, back;

  static ContentsOfObject of(const fs_object& object);
  void put_keys(forceserver_ForceObject& out) const;
  void put_handles(fs_object& out) const;
};

// Writes the contents of this site's objects, piece by piece, at most so fast that motions are not held up.
class ContentWriter {
 public:
  explicit ContentWriter(const Room& room) : room_(room) {}

  ContentRef find(const std::string& key) const;    // null: it is not among them
  void use(const ContentRef& content);              // one object more has it; null: nothing
  void unuse(const std::string& key, double now);   // one less
  void write_again(const std::string& key);         // some site has missed it
  void write_all_again();                           // a site has lost all
  // Writes what may be written by now; s.
  void write(double now);

 private:
  struct Entry {
    ContentRef content;
    uint32_t uses = 0;
    double unused_since = 0;  // s
  };
  struct Next {
    std::string key;
    uint32_t piece = 0;
  };
  void queue(const std::string& key);
  bool write_piece(const Content& content, uint32_t piece, bool disposes, size_t& bytes) const;
  void drop_unused(double now);

  const Room& room_;
  std::map<std::string, Entry> entries_;
  std::deque<Next> queue_;
  std::deque<std::pair<ContentRef, uint32_t>> disposed_;  // with the next piece to be disposed of
  double last_ = 0, allowance_ = 0;  // s; bytes that may be written at once
};

// Puts together the contents of other sites' objects.
class ContentReader {
 public:
  ContentReader(const Room& room, Worker& worker) : room_(room), worker_(worker) {}

  void take(double now);
  ContentRef find(const std::string& key, double now);  // null: it has not come yet, and is wanted from now on
  uint64_t news() const noexcept { return news_; }      // grows when another one is here
  std::vector<std::string> wanted(double now) const;    // of which nothing has come for 5 s; 16 at most
  void drop_unused(double now);

 private:
  struct Parts {
    uint32_t pieces = 0, received = 0;
    size_t bytes = 0;
    double arrived = 0;  // s, when the newest piece came
    bool is_being_made = false;
    std::vector<bool> has;
    // Of each piece:
    std::vector<std::vector<fs_vec3>> points;
    std::vector<std::vector<uint32_t>> triangles;
    std::vector<std::vector<double>> numbers;  // of a curve, of a surface
    forceserver_Shape shape{};                 // of the first piece that came, without sequences
    forceserver_Curve curve{};
    forceserver_Surface surface{};
  };
  using PartsRef = std::shared_ptr<Parts>;
  enum Kind { shape_kind, curve_kind, surface_kind };

  // The parts that a piece belongs to; null: it is not needed, or makes no sense.
  PartsRef open(Kind kind, const std::string& key, uint32_t piece, uint32_t pieces, size_t bytes);
  void close(Kind kind, const std::string& key, const PartsRef& parts, uint32_t piece);
  void keep(const ContentRef& content, const std::string& key);

  const Room& room_;
  Worker& worker_;
  std::map<std::pair<Kind, std::string>, PartsRef> parts_;
  struct Ready {
    ContentRef content;
    double used = 0;  // s, last known to be used
  };
  std::map<std::string, Ready> ready_;
  std::map<std::string, double> bad_;      // contents that cannot be made, and when that was tried, s
  std::map<std::string, double> wanted_;  // since when nothing of it has come, s
  double now_ = 0;                          // s, of the last take
  size_t bytes_ = 0;                        // of parts
  uint64_t news_ = 0;
  bool is_full_told_ = false;
};

}  // namespace bridge
