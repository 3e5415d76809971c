#include "servo/channels.h"

#include <algorithm>
#include <iterator>

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
