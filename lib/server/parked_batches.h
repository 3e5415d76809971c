// Batches of a client that cannot be applied yet. One that needs a shape or curve which is being built waits for that, and
// later ones that are about the same things wait behind it; all others go on. ParkedBatches knows what those that wait hold up. A
// request that changes another client's object is parked as a batch, too.
#pragma once

#include <deque>
#include <set>
#include <string>

#include "transfer/asset.h"
#include "transfer/batch.h"

namespace fs {

// What a batch is about: the things that a later batch must not overtake.
struct Subjects {
  std::set<std::string, std::less<>> names;  // of objects; "client/object" of foreign ones
  std::set<std::string, std::less<>> owners;  // the clients of foreign ones
  std::set<uint64_t> ids;  // of the assets that it needs, or forgets
  bool is_about_all = false, is_about_view = false, is_forget = false;

  // False: the change cannot be part of a batch.
  bool add(const Change& change);
};

// A batch as it came.
struct ReceivedBatch {
  uint64_t serial = 0;
  Batch changes;
  Subjects about;
  bool is_request = false;  // one change of another client's object, which is answered when it is done
};

class ParkedBatches {
 public:
  bool is_empty() const noexcept { return batches_.empty(); }
  size_t cost() const noexcept { return cost_; }  // in changes; a memory file costs as much as many
  const std::deque<ReceivedBatch>& batches() const noexcept { return batches_; }
  size_t requests() const noexcept { return requests_; }

  // Whether a batch that is about this has to wait behind one that waits already.
  bool holds_up(const Subjects& about) const;
  bool holds_up(std::string_view name) const { return all_ > 0 || names_.contains(name); }
  bool holds_up_view() const noexcept { return view_ > 0 || all_ > 0; }
  bool needs(uint64_t id) const { return ids_.contains(id) || request_ids_.contains(id); }

  void add(ReceivedBatch&& batch);
  std::deque<ReceivedBatch> take_all();

  // Removes the first batch that forgets this asset. False: there is none. Then count_next() is to be called until it is false.
  bool take_forget(uint64_t id);
  bool count_next();

  // An asset that some wait for is ready. True: it is time to look through them now. Where many wait, they are not looked
  // through after every asset, but every few turns.
  bool note_ready() noexcept {
    is_retry_due_ = true;
    return batches_.size() <= few;
  }
  bool is_retry_due() noexcept {  // called once a turn
    return is_retry_due_ && (turns_until_retry_ == 0 || --turns_until_retry_ == 0);
  }

 private:
  static constexpr size_t few = 32;  // that cost little to look through

  void count(const ReceivedBatch& batch);
  void count_nothing() noexcept;

  std::deque<ReceivedBatch> batches_;
  // What all of them together are about.
  std::set<std::string, std::less<>> names_;
  std::set<uint64_t> ids_, request_ids_;  // the latter of requests, which do not hold up a forget
  size_t all_ = 0, view_ = 0, cost_ = 0, requests_ = 0;
  size_t counted_ = 0;  // batches that are in these
  bool is_retry_due_ = false;
  size_t turns_until_retry_ = 0;
};

}  // namespace fs
