#pragma once

#include <algorithm>

namespace romap::nerf {

// Divides CPU time equally among participants that always want more: whoever has used the least runs next (start-time
// fair queueing; Goyal, Vin and Cheng, SIGCOMM 1996). Time during which a participant wants nothing is not saved up.
class FairShare {
 public:
  // The account of one participant.
  struct Account {
    double used_s = 0;        // virtual time
    double expected_s = 0.1;  // of the next turn: what the last one took
    int running = 0;          // turns that have begun and not ended
    bool is_active = false;
  };

  // Call before Claim(), whenever it may have changed whether the participant wants a turn.
  void Update(bool wants_turn, Account* account) const {
    if (wants_turn && !account->is_active) account->used_s = std::max(account->used_s, now_s_);
    account->is_active = wants_turn || account->running > 0;
  }
  // The participant with the smallest value is next.
  static double Claim_s(const Account& account) { return account.used_s + account.running * account.expected_s; }

  void BeginTurn(Account* account) {
    now_s_ = std::max(now_s_, account->used_s);
    ++account->running;
  }
  // `cost_s`: the CPU time of the turn.
  static void EndTurn(double cost_s, Account* account) {
    --account->running;
    account->used_s += cost_s;
    account->expected_s = cost_s;
  }

 private:
  double now_s_ = 0;  // virtual time at the beginning of the newest turn
};

}  // namespace romap::nerf
