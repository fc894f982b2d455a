#pragma once

namespace romap {

// Each runs a kernel that is right, or the same kernel with one mistake planted.

// Tree sum in shared memory; wrong: no barrier between the steps.
void RunTreeSum(bool with_barriers);
// Each lane reads its neighbour's value from shared memory; wrong: nothing between write and read.
void RunLaneExchange(bool with_warp_barrier);
// All threads of all blocks count into one word; wrong: a plain addition.
void RunCount(bool atomically);
// Each thread writes its own word, and then reads one; wrong: that of the next block.
void RunNeighbourRead(bool own_word);
// A buffer in shared memory is used twice; wrong: refilled while others still read.
void RunBufferReuse(bool with_barrier_before_refill);

}  // namespace romap
