#include "servo/channels.h"

#include <algorithm>
#include <iterator>

#include "base/clock.h"
#include "base/error.h"

namespace fs {

void Channels::start(Ref<Channel> own) {
  const Ref<List> list = make_ref<List>();
  list->channels.push_back(std::move(own));
  posted_ = list;
  mailbox_.prime(posted_);
}

void Channels::stop() noexcept {
  const std::lock_guard lock(mutex_);
  if (!posted_) return;
  for (const Ref<Channel>& channel : posted_->channels) channel->detach();
  posted_ = nullptr;
  mailbox_.clear();  // also frees older lists, which may still refer to removed channels
}

void Channels::add(const Ref<Channel>& channel) {
  const std::lock_guard lock(mutex_);
  if (!posted_) fail(FS_ERROR_STATE, "the servo has been stopped");
  const Ref<List> list = make_ref<List>();
  list->channels = posted_->channels;
  list->channels.push_back(channel);
  channel->take_over_from(posted_->channels);
  posted_ = list;
  mailbox_.post(posted_);
}

fs_response Channels::evaluate(const fs_state& hand, bool has_pose, bool begins_anew, const ImpactLimit& impacts, double now,
                               double period) noexcept {
  mailbox_.fetch();
  impacts_.begin(impacts);
  const std::vector<Ref<Channel>>& channels = mailbox_.front()->channels;
  fs_response out{};
  out.proxy = identity_pose();
  for (size_t i = 0; i < channels.size(); ++i) {
    Channel& channel = *channels[i];
    if (channel.is_gone()) continue;
    channel.fetch(now);
    if (begins_anew) channel.forget_touches();
    if (!has_pose) {
      channel.lose_hand(now, hand.flags);
    } else if (i == 0) {
      out = channel.evaluate(hand, now, impacts_);  // the servo's own scene
    } else {
      const double start = period > 0 ? steady_now() : 0;
      const fs_response its = channel.evaluate(hand, now, impacts_);
      fs::add(out, its);
      const Vec3 at = hand.pose.position;
      if (norm(its.proxy.position - at) > norm(out.proxy.position - at)) out.proxy = its.proxy;
      if (period > 0) channel.charge(steady_now() - start, period);
    }
  }
  return out;
}

void Channels::publish(const Wrench& sent, uint32_t flags, uint64_t tick) noexcept {
  for (const Ref<Channel>& channel : mailbox_.front()->channels) {
    if (!channel->is_gone()) channel->publish(sent, flags, tick);
  }
}

std::vector<Ref<Channel>> Channels::present() {
  const std::lock_guard lock(mutex_);
  return posted_ ? posted_->channels : std::vector<Ref<Channel>>{};
}

std::vector<Ref<SceneBudget>> Channels::budgets() {
  std::vector<Ref<SceneBudget>> out;
  for (const Ref<Channel>& channel : present()) out.push_back(channel->budget());
  return out;
}

void Channels::note(const fs_event& event) {
  for (const Ref<Channel>& channel : present()) channel->scene().note(event);
}

Wrench Channels::own_wrench() {
  const std::lock_guard lock(mutex_);
  return posted_ ? posted_->channels.front()->wrench() : Wrench{};
}

size_t Channels::count() {
  const std::lock_guard lock(mutex_);
  return posted_ ? posted_->channels.size() - 1 : 0;
}

void Channels::reap() {
  const std::lock_guard lock(mutex_);
  if (!posted_) return;
  const std::vector<Ref<Channel>>& present = posted_->channels;
  const auto is_gone = [](const Ref<Channel>& channel) { return channel->is_gone(); };
  if (std::any_of(present.begin(), present.end(), is_gone)) {
    const Ref<List> list = make_ref<List>();
    std::remove_copy_if(present.begin(), present.end(), std::back_inserter(list->channels), is_gone);
    posted_ = list;
    mailbox_.post(posted_);
  } else if (mailbox_.take_back()) {  // also frees the list that the tick no longer uses
    mailbox_.post(posted_);
  }
}

}  // namespace fs
