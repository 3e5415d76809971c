// A client's life at the server: it says who it is, sends messages, has a turn in each period, and goes. The session reads
// the messages, applies the changes that it can, and parks those that have to wait: one coroutine does it (work.h). Client
// holds what the server knows of the client, Changes applies changes, Requests answers requests. Nothing that comes is
// trusted: it is copied, checked, then used; what is not good harms this client alone. All of it runs on the server's thread.
#pragma once

#include <list>
#include <memory>
#include <span>
#include <string>

#include "server/allowance.h"
#include "server/changes.h"
#include "server/client.h"
#include "server/message.h"
#include "server/requests.h"
#include "server/syncs.h"
#include "server/worker.h"

namespace fs {

class Session {
 public:
  // refusal: FS_OK, or why the client will be refused when it says who it is.
  Session(Host& host, uint64_t id, Descriptor socket, const Peer& peer, fs_status refusal);

  Client& client() const noexcept { return *client_; }
  const std::shared_ptr<Client>& shared_client() const noexcept { return client_; }
  bool is_refused() const noexcept { return refusal_ != FS_OK; }
  Usage& usage() noexcept { return usage_; }
  bool is_listed = false;  // in the server's list of those that have more to do

  bool is_idle() const noexcept { return client_->work.state() == Work::State::idle; }
  // Something is left to do, beside messages that may have come.
  bool has_more() const noexcept { return client_->work.state() == Work::State::ready || !done_.empty() || is_retry_due_; }
  // Goes on with the client's work, or handles messages that are there, for about a slice of time.
  void resume() noexcept { client_->work.resume(); }
  // For a client that has not said who it is: looks whether it does so now.
  void look_for_greeting() noexcept;
  // A worker has done jobs for this client: moves the first of them here. What is left to do is done when it is resumed.
  void take_job(std::list<Worker::Job>& done) noexcept;

  // Called each period: takes the moves, and posts the changes to the servo.
  void turn(double now) noexcept;
  // Called after all sessions had their turn: tells the client which of its changes a tick has used.
  void end_turn() noexcept;
  // Called now and then: passes on the scene's events, and looks after the channel.
  void keep_house() noexcept;

  bool is_busy() const noexcept;  // it works, or waits for the servo or a worker
  void set_asleep(bool is_asleep) noexcept;
  bool has_moves() const noexcept { return client_->moves.has_new(); }

 private:
  Task serve();
  void finish_jobs();
  bool receive_next(Message& message);
  bool receive_greeting();
  bool handle_at_once(Message& message);
  Task handle(Message& message);
  void take_asset(PackedAsset&& packed);
  bool finish_asset(uint64_t id, ClientAssets::Upload&& upload);  // true: parked changes can be looked through now
  bool is_ready(const ReceivedBatch& batch) const;
  void park(ReceivedBatch&& batch);
  Task apply(ReceivedBatch& batch);
  Task retry_parked();
  void note_applied() noexcept;
  void regulate() noexcept;

  const std::shared_ptr<Client> client_;
  Syncs syncs_;
  Changes changes_{*client_, syncs_};
  Requests requests_{*client_, syncs_};
  const fs_status refusal_;
  const double since_;
  Usage usage_{1e-3};  // s; a new client does not come first
  uint64_t last_serial_ = 0;
  bool is_reading_ = true;
  bool are_moves_taken_ = false;  // in this turn
  bool is_retry_due_ = false;     // parked changes are to be looked through
  std::list<Worker::Job> done_;
  const Task serving_ = serve();  // the last member: all others are there when it begins
};

}  // namespace fs
