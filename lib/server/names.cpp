#include "server/names.h"

namespace fs {

Names::Named* Names::find_named(std::string_view name) {
  const auto found = all_.find(name);
  return found == all_.end() ? nullptr : &*found;
}

const NameRecord* Names::find(std::string_view name) const {
  const auto found = all_.find(name);
  return found == all_.end() ? nullptr : &found->second;
}

const NameRecord* Names::object(std::string_view name) const {
  const NameRecord* const record = find(name);
  return record && record->is_there ? record : nullptr;
}

// Called before the record is changed: there may be no memory.
void Names::list(Named& named, Kind kind, bool is_listed) {
  auto& place = named.second.places[kind];
  if (place.has_value() == is_listed) return;
  if (is_listed) {
    place = lists_[kind].insert(lists_[kind].end(), &named);
  } else {
    lists_[kind].erase(*place);
    place.reset();
  }
}

void Names::erase_if_empty(const Named& named) {
  const Listed& record = named.second;
  if (!record.is_there && !record.absent && record.editor.empty()) all_.erase(all_.find(named.first));
}

// ------------------------------------------------------------------------------------------------------------- objects

void Names::add(const std::string& name) {
  Named& named = make(name);
  list(named, absent, false);
  named.second.absent.reset();
  objects_ += !named.second.is_there;
  named.second.is_there = true;
}

void Names::await(const std::string& name) {
  Named& named = make(name);
  list(named, awaited, true);
  named.second.awaited = 0;
}

void Names::forget(std::string_view name) {
  Named* const named = find_named(name);
  if (!named) return;
  if (named->second.slot != wire::no_slot) slots_[named->second.slot] = nullptr;
  objects_ -= named->second.is_there;
  for (const Kind kind : {absent, untold, awaited}) list(*named, kind, false);
  all_.erase(all_.find(name));
}

bool Names::bind(std::string_view name, uint32_t slot, uint64_t serial) {
  Named& named = *find_named(name);
  NameRecord& record = named.second;
  if (record.slot != wire::no_slot) slots_[std::exchange(record.slot, wire::no_slot)] = nullptr;
  if (slot == wire::no_slot) return false;
  if (Named* const other = slots_[slot]) {  // it has got this slot since; the later change wins
    if (other->second.after > serial) return false;
    other->second.slot = wire::no_slot;
  }
  slots_[slot] = &named;
  record.slot = slot;
  record.after = serial;
  return true;
}

void Names::set_absent(const std::string& name, const Absence& why) {
  Named& named = make(name);
  list(named, absent, true);
  named.second.absent = why;
}

void Names::drop_absent(std::string_view name) {
  Named* const named = find_named(name);
  if (!named || !named->second.absent) return;
  list(*named, absent, false);
  named->second.absent.reset();
  erase_if_empty(*named);
}

void Names::drop_absents() {
  while (!lists_[absent].empty()) drop_absent(lists_[absent].front()->first);
}

// ---------------------------------------------------------------------------------------- what the client has to be told

void Names::set_untold(const std::string& name, const std::string& editor) {
  Named& named = make(name);
  list(named, untold, true);
  named.second.editor = editor;
}

void Names::note_told(std::string_view name) {
  Named* const named = find_named(name);
  if (!named) return;
  list(*named, untold, false);
  named->second.editor.clear();
  erase_if_empty(*named);
}

const std::string* Names::next_untold(const ParkedBatches& parked) const {
  for (const Named* const named : lists_[untold]) {
    if (!parked.holds_up(named->first)) return &named->first;
  }
  return nullptr;
}

// ------------------------------------------------------------------------------------------------ when one is refused

NameRecord Names::record_of(std::string_view name) const {
  const NameRecord* const record = find(name);
  return record ? *record : NameRecord{};
}

bool Names::put_back(const std::string& name, const NameRecord& was) {
  if (was.absent) set_absent(name, *was.absent);
  if (!was.editor.empty()) set_untold(name, was.editor);
  if (!was.is_there) return false;
  add(name);
  Named& named = *find_named(name);
  list(named, awaited, was.awaited.has_value());
  named.second.awaited = was.awaited;
  named.second.id = was.id;
  return bind(name, was.slot, was.after);
}

}  // namespace fs
