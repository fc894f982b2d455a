#include "server/session/sender_claim.h"

#include <utility>

namespace romap::session {

bool SenderClaim::Holder::Run(const std::function<void()>& send) {
  std::lock_guard lock(mutex_);
  if (!active_) return false;
  send();
  return true;
}

bool SenderClaim::IsHeld() const {
  std::lock_guard lock(mutex_);
  return held_;
}

std::shared_ptr<SenderClaim::Holder> SenderClaim::Attach(const std::string& token, std::function<void()> on_replaced) {
  std::lock_guard lock(mutex_);
  if (held_ && token != token_) return nullptr;
  if (last_) {
    {
      // Waits for its input in progress, so that inputs of the two streams are not mixed.
      std::lock_guard sending(last_->mutex_);
      last_->active_ = false;
    }
    if (held_) last_->on_replaced_();
  }
  held_ = true;
  last_ = std::make_shared<Holder>(std::move(on_replaced));
  return last_;
}

void SenderClaim::Release(const std::shared_ptr<Holder>& holder) {
  std::lock_guard lock(mutex_);
  if (holder == last_) held_ = false;
}

}  // namespace romap::session
