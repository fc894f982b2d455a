#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>

namespace romap::session {

// The right to send inputs to a session, which one stream has at a time. A client whose connection broke takes the
// right back from its old stream with the token, although this server may not know yet that the connection is gone.
// Thread-safe.
class SenderClaim {
 public:
  // Of one stream.
  class Holder {
   public:
    explicit Holder(std::function<void()> on_replaced) : on_replaced_(std::move(on_replaced)) {}

    // Runs `send` if the stream still has the right. False: it was replaced or released.
    bool Run(const std::function<void()>& send);

   private:
    friend class SenderClaim;

    const std::function<void()> on_replaced_;
    std::mutex mutex_;  // held while an input is sent
    bool active_ = true;
  };

  explicit SenderClaim(std::string token) : token_(std::move(token)) {}

  const std::string& token() const { return token_; }
  bool IsHeld() const;

  // Null: another stream has the right, and `token` is not that of the session. Otherwise the other stream is replaced:
  // its input in progress is sent first, it sends no more, and its `on_replaced` is called.
  std::shared_ptr<Holder> Attach(const std::string& token, std::function<void()> on_replaced);
  // Does not wait for an input in progress. No effect if the stream was replaced.
  void Release(const std::shared_ptr<Holder>& holder);

 private:
  const std::string token_;
  mutable std::mutex mutex_;
  bool held_ = false;
  std::shared_ptr<Holder> last_;  // also after its release: its last input may still be in progress
};

}  // namespace romap::session
