// The versions of a name, or of where a scene's tool stands, as rows of a snapshot: the poster's side of field/weight.h.
// Every call needs the scene's lock.
//
// They form a chain: `previous` leads from the newest to those that fade out. After a tick a chain has three rows at most:
// one fades out, one comes in, and the newest waits for the one that comes in. Versions that come between two ticks are
// appended, and go again with the next tick.
#pragma once

#include "scene/reader.h"

namespace fs {

// Rows has: row(i), a const Version&; weight(i), the servo's Weight&, by a pointer that is null without a servo; used(), the
// sequence that the servo has used; own(i), after which edit(i), a Version&, and drop(i) cannot fail; and sequence(), of the
// next snapshot.
template <class Rows>
class Versions {
 protected:
  bool has_begun(uint32_t i) const noexcept {
    const Weight* const weight = rows().weight(i);
    return !weight || weight->has_begun(rows().row(i).version);
  }
  // Whether the newest has not begun: the one before it is felt still.
  bool is_waiting(uint32_t newest) const noexcept { return rows().row(newest).previous != no_row && !has_begun(newest); }

  // Its weight is 0, and no tick will raise it again.
  bool is_gone(uint32_t i) const noexcept {
    const auto& it = rows().row(i);
    const Weight* const weight = rows().weight(i);
    if (!weight) return true;
    // A row that has not begun can go once a tick has used the snapshot with its successor, which may itself be wanted out.
    if (!has_begun(i)) return it.next != no_row && rows().row(it.next).created <= rows().used();
    if (weight->value() > 0 || weight->coming() > 0) return false;
    return it.next != no_row ? has_begun(it.next) : !it.is_in && it.sequence <= rows().used();
  }

  void want_out(uint32_t i) noexcept {
    auto& it = rows().edit(i);
    if (it.is_in) it.sequence = rows().sequence();
    it.is_in = false;
    it.expiry = never;
  }

  // Lets go of what is gone behind the newest. True: something is to be posted; until then a version that waited for what has
  // gone goes on waiting. What becomes of the row before the one that goes, with A <- B <- C and B gone:
  //   A is felt, B has not begun and never will: C is now what A waits to begin;
  //   A is felt, B had begun and has faded out: A was wanted out because of B, and stays wanted out; it begins nothing more;
  //   there is no A: nothing.
  bool tidy_older(uint32_t newest) {
    bool has_changed = false;
    for (uint32_t above = newest;;) {
      const uint32_t i = rows().row(above).previous;
      if (i == no_row) return has_changed;
      if (!is_gone(i)) {
        above = i;
        continue;
      }
      const uint32_t older = rows().row(i).previous, next = rows().row(i).next;
      for (const uint32_t changed : {above, i, older}) {
        if (changed != no_row) rows().own(changed);
      }
      if (!has_begun(i) && !rows().weight(i)->replace_waiting(rows().row(i).version, 0)) {  // a tick has just begun it
        above = i;
        continue;
      }
      if (older != no_row && !has_begun(i)) {
        rows().edit(older).next = next;
      } else if (older != no_row) {
        want_out(older);
        rows().edit(older).next = no_row;
      }
      rows().edit(above).previous = older;
      if (older != no_row) rows().edit(older).newer = above;
      rows().drop(i);
      has_changed = true;
    }
  }

 private:
  Rows& rows() noexcept { return static_cast<Rows&>(*this); }
  const Rows& rows() const noexcept { return static_cast<const Rows&>(*this); }
};

}  // namespace fs
