#pragma once

namespace romap {

// Each function runs a correct kernel, or the same kernel with one deliberate mistake.

// Tree sum in shared memory. Mistake: no barrier between the steps.
void RunTreeSum(bool with_barriers);
// Each lane reads the value of the adjacent lane from shared memory. Mistake: no warp barrier between write and read.
void RunLaneExchange(bool with_warp_barrier);
// All threads of all blocks increment one word. Mistake: an ordinary addition.
void RunCount(bool atomically);
// Each thread writes its own word and then reads one. Mistake: it reads a word of the next block.
void RunNeighborRead(bool own_word);
// A buffer in shared memory is used twice. Mistake: it is refilled while other threads still read it.
void RunBufferReuse(bool with_barrier_before_refill);

}  // namespace romap
