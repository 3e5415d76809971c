#include "servo/channels.h"

#include <algorithm>
#include <iterator>

#include "base/clock.h"
#include "base/error.h"

namespace fs {

// A site whose clients have several limits, as an earlier server of the servo had another, counts as several: so the limit of what
// is still felt stays.
Channels::List::List(std::vector<Ref<Channel>> those) : channels(std::move(those)) {
  for (size_t i = 0; i < channels.size(); ++i) {
    const auto name = channels[i]->owner().site();
    const Channel::Limits& limits = channels[i]->limits();
    if (!name || !(limits.force < never)) continue;
    const auto is_its = [&](const Site& site) { return site.name == *name && site.limits == limits; };
    const auto found = std::find_if(sites.begin(), sites.end(), is_its);
    site_of.resize(channels.size(), no_site);
    site_of[i] = static_cast<size_t>(found - sites.begin());
    if (found == sites.end()) sites.push_back({std::string(*name), limits, {}, 1});
  }
}

void Channels::start(Ref<Channel> own) {
  posted_ = make_ref<List>(std::vector{std::move(own)});
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
  std::vector<Ref<Channel>> channels = posted_->channels;
  channels.push_back(channel);
  const Ref<const List> list = make_ref<List>(std::move(channels));
  channel->count_lost(posted_->channels);
  posted_ = list;
  mailbox_.post(posted_);
}

fs_response Channels::evaluate(const fs_state& hand, bool has_pose, bool begins_anew, const ImpactLimit& impacts, double now,
                               double period) noexcept {
  mailbox_.fetch();
  impacts_.begin(impacts);
  const List& list = *mailbox_.front();
  const std::vector<Ref<Channel>>& channels = list.channels;
  for (Site& site : list.sites) site.sum = {};
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
      channel.note_added(1);
    } else {
      const double start = period > 0 ? steady_now() : 0;
      const fs_response its = channel.evaluate(hand, now, impacts_);
      Site* const site = list.site(i);
      fs::add(site ? site->sum : out, its);
      if (!site) channel.note_added(1);
      const Vec3 at = hand.pose.position;
      if (norm(its.proxy.position - at) > norm(out.proxy.position - at)) out.proxy = its.proxy;
      if (period > 0) channel.charge(steady_now() - start, period);
    }
  }
  if (has_pose && !list.sites.empty()) add_sites(list, out);
  return out;
}

// [rt] What the clients of each site give together, within the limit of one.
void Channels::add_sites(const List& list, fs_response& out) noexcept {
  for (Site& site : list.sites) {
    site.part = clamp(site.sum, site.limits);
    fs::add(out, site.sum);
  }
  for (size_t i = 0; i < list.channels.size(); ++i) {
    const Site* const site = list.site(i);
    if (site && !list.channels[i]->is_gone()) list.channels[i]->note_added(site->part);
  }
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
    std::vector<Ref<Channel>> rest;
    std::remove_copy_if(present.begin(), present.end(), std::back_inserter(rest), is_gone);
    posted_ = make_ref<List>(std::move(rest));
    mailbox_.post(posted_);
  } else if (mailbox_.take_back()) {  // also frees the list that the tick no longer uses
    mailbox_.post(posted_);
  }
}

}  // namespace fs
