// What somebody wants a scene to be: changes that are made at once, or collected in a group until it is committed. A scene may
// have several groups at a time: those that threads of the application have open, and those of others (scene_group.h). Every
// call needs the scene's lock.
#pragma once

#include <memory_resource>
#include <vector>

#include "scene/evaluated_scene.h"

namespace fs {

// Changes that belong together and are not felt yet.
struct OpenGroup {
  std::pmr::monotonic_buffer_resource memory;  // of the changes, which lie in the order in which they came
  std::pmr::map<std::string, ObjectState, std::less<>> changes{&memory};
  using Change = decltype(changes)::value_type;
  std::vector<Change*> order;  // in which they came, until a commit sorts them
  size_t added = 0;            // names that the scene does not have
  size_t committed = 0;        // how many of order are, in a commit that takes several steps
  std::vector<NewName> new_names;  // beside order, in a commit; empty: not made, or not new
  ViewChange view;

  ObjectState* find(std::string_view name);  // null: the group does not change it
  void put(std::string_view name, ObjectState wanted, bool is_new);
  void shift(double by) noexcept;  // all times, s
};

class Edits {
 public:
  // group: that the changes join; null: they are made at once.
  Edits(EvaluatedScene& evaluated, OpenGroup* group) : evaluated_(evaluated), group_(group) {}

  // The scene as the group has it.
  bool find(std::string_view name, ObjectState& out) const;
  ObjectState require(const char* name) const;  // NOT_FOUND
  fs_frame frame() const;
  const std::vector<Vec3>& tool() const;
  double tool_radius() const;
  size_t count() const;  // of objects
  // With the group, or as the scene is evaluated. The tool stands where the last tick had it, or where the clutch holds
  // it.
  fs_view view(bool with_group) const;
  // Calls f(name, ObjectState) for each object, in the order in which the names first came.
  template <class F>
  void for_each(F&& f) const;

  // Changes, all checked.
  void require_room(const std::vector<ParsedObject>& objects);  // FULL
  void require_room();  // for what the group adds: others may have added something since. FULL
  // Refuses a radius of the tool's points above 0 (m) if one of the scene's objects, or of `objects`, is a solid mesh. UNSUPPORTED
  void refuse_solid_meshes(double radius, const std::vector<ParsedObject>& objects = {}) const;
  // All of it, or the parts that are named. is_change: of an object that is there; where it has been removed by the time the
  // group is committed, nothing is made of it.
  void put(const ParsedObject& object, uint32_t parts, bool is_change);
  void move(const char* name, const Pose& pose, const Twist* twist, double time);
  void set_movement(const char* name, const Motion& motion, const Track& track);
  bool move_to(const std::string& name, const Motion& motion, double now);  // its twist is worked out; false: there is none
  void remove(const char* name);
  void clear();
  void change_view(ViewChange change);

  OpenGroup* group() const noexcept { return group_; }
  bool commit(size_t most);  // the group, by at most so many objects; true: all of it is done

 private:
  ObjectState require(std::string_view name) const;
  void put(std::string_view name, ObjectState wanted, bool is_more_than_moved, bool is_known);
  void merge(std::string_view name, ObjectState& wanted);
  void put_moved(std::string_view name, ObjectState known, double now);
  void sort();
  void keep_rest() noexcept;

  EvaluatedScene& evaluated_;
  OpenGroup* const group_;
};

template <class F>
void Edits::for_each(F&& f) const {
  ObjectState known;
  for (const std::string_view name : evaluated_.objects.in_order()) {
    if (find(name, known)) f(std::string(name), known);
  }
  if (!group_) return;
  for (const OpenGroup::Change* change : group_->order) {
    const auto& [name, wanted] = *change;
    if (!wanted.is_removed && !evaluated_.objects.has(name)) f(name, wanted);
  }
}

}  // namespace fs
