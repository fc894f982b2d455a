#include "tests/support/cuda_on_host/race_checker.h"

#include <link.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <unordered_map>
#include <utility>

#include "tests/support/cuda_on_host/block_runner.h"
#include "tests/support/cuda_on_host/runtime_api.h"

namespace romap::cuda_on_host {
namespace {

constexpr uintptr_t kWordBytes = 4;

enum class Memory { kOther, kShared, kDevice };

struct Access {
  ThreadStamp stamp;  // inactive: no access yet
  bool atomic = false;
};

struct Word {
  Access write;
  Access read;
  Access older_read;  // of another thread than `read`
};

struct Log {
  std::mutex mutex;
  std::unordered_map<uintptr_t, Word> words;
  int races = 0;
  std::string first;
  DeviceTraffic traffic;
};

Log& TheLog() {
  static Log log;
  return log;
}

struct Range {
  uintptr_t begin = 0;
  uintptr_t end = 0;
};

// The thread-local data of the main program for this OS thread, which contain the emulated __shared__ variables.
Range ThreadLocalData() {
  thread_local Range range;
  if (range.begin != 0) return range;
  dl_iterate_phdr(
      [](dl_phdr_info* info, size_t, void* data) {
        if (info->dlpi_name[0] != 0 || info->dlpi_tls_data == nullptr) return 0;
        for (int i = 0; i < info->dlpi_phnum; ++i) {
          if (info->dlpi_phdr[i].p_type != PT_TLS) continue;
          const auto begin = reinterpret_cast<uintptr_t>(info->dlpi_tls_data);
          *static_cast<Range*>(data) = {begin, begin + info->dlpi_phdr[i].p_memsz};
        }
        return 0;
      },
      &range);
  return range;
}

Memory KindOf(uintptr_t address) {
  const Range tls = ThreadLocalData();
  if (InDynamicShared(address) || (address >= tls.begin && address < tls.end)) return Memory::kShared;
  return InDeviceMemory(address) ? Memory::kDevice : Memory::kOther;
}

// Whether a barrier orders `earlier` before `now`, or both belong to one thread.
bool Ordered(const ThreadStamp& earlier, const ThreadStamp& now, Memory memory) {
  if (!earlier.active || earlier.launch != now.launch) return true;
  if (earlier.block != now.block) return memory == Memory::kShared;  // each block has its own
  if (earlier.thread == now.thread || earlier.block_barriers != now.block_barriers) return true;
  return earlier.thread / kWarpSize == now.thread / kWarpSize && earlier.warp_barriers != now.warp_barriers;
}

void Report(const Access& earlier, const Access& now, Memory memory, bool write) {
  Log& log = TheLog();
  if (log.races++ > 0) return;
  char text[200];
  std::snprintf(text, sizeof(text), "%s memory: %s by block %llu thread %u after access by block %llu thread %u",
                memory == Memory::kShared ? "shared" : "device", write ? "write" : "read",
                static_cast<unsigned long long>(now.stamp.block), now.stamp.thread,
                static_cast<unsigned long long>(earlier.stamp.block), earlier.stamp.thread);
  log.first = text;
  std::fprintf(stderr, "cuda_on_host: race in %s\n", text);
}

void RecordWord(Word& word, const Access& now, Memory memory, bool write) {
  const auto clashes = [&](const Access& earlier) {
    return !Ordered(earlier.stamp, now.stamp, memory) && !(earlier.atomic && now.atomic);
  };
  if (clashes(word.write)) {
    Report(word.write, now, memory, write);
  } else if (write && clashes(word.read)) {
    Report(word.read, now, memory, write);
  } else if (write && clashes(word.older_read)) {
    Report(word.older_read, now, memory, write);
  }
  if (write) {
    word.write = now;
  } else {
    const ThreadStamp& last = word.read.stamp;
    if (last.thread != now.stamp.thread || last.block != now.stamp.block) word.older_read = word.read;
    word.read = now;
  }
}

void Record(const volatile void* p, size_t bytes, bool write, bool atomic) {
  const Access now{CurrentStamp(), atomic};
  if (!now.stamp.active) return;
  const auto address = reinterpret_cast<uintptr_t>(p);
  const Memory memory = KindOf(address);
  if (memory == Memory::kOther) return;
  std::lock_guard lock(TheLog().mutex);
  if (memory == Memory::kDevice) {
    DeviceTraffic& traffic = TheLog().traffic;
    if (atomic) {
      traffic.atomic += write ? bytes : 0;  // the emulated exchange reads first
    } else {
      (write ? traffic.written : traffic.read) += bytes;
    }
  }
  for (uintptr_t at = address / kWordBytes * kWordBytes; at < address + bytes; at += kWordBytes) {
    RecordWord(TheLog().words[at], now, memory, write);
  }
}

}  // namespace

int RaceCount() {
  std::lock_guard lock(TheLog().mutex);
  return TheLog().races;
}

std::string FirstRace() {
  std::lock_guard lock(TheLog().mutex);
  return TheLog().first;
}

DeviceTraffic TakeDeviceTraffic() {
  std::lock_guard lock(TheLog().mutex);
  return std::exchange(TheLog().traffic, {});
}

void ResetRaces() {
  std::lock_guard lock(TheLog().mutex);
  TheLog().words.clear();
  TheLog().races = 0;
  TheLog().first.clear();
}

}  // namespace romap::cuda_on_host

// Functions called by code compiled with -fsanitize=thread. Names and signatures are those of the compiler.
using romap::cuda_on_host::Record;

extern "C" {

void __tsan_init() {}
void __tsan_func_entry(void*) {}
void __tsan_func_exit() {}
void __tsan_vptr_update(void**, void*) {}
void __tsan_vptr_read(void**) {}
void __tsan_read_range(void* p, size_t bytes) { Record(p, bytes, false, false); }
void __tsan_write_range(void* p, size_t bytes) { Record(p, bytes, true, false); }
void __tsan_atomic_thread_fence(int) { __atomic_thread_fence(__ATOMIC_SEQ_CST); }
void __tsan_atomic_signal_fence(int) {}

#define ROMAP_TSAN_ACCESS(bytes)                                                 \
  void __tsan_read##bytes(void* p) { Record(p, bytes, false, false); }           \
  void __tsan_write##bytes(void* p) { Record(p, bytes, true, false); }           \
  void __tsan_volatile_read##bytes(void* p) { Record(p, bytes, false, false); }  \
  void __tsan_volatile_write##bytes(void* p) { Record(p, bytes, true, false); }  \
  void __tsan_unaligned_read##bytes(void* p) { Record(p, bytes, false, false); } \
  void __tsan_unaligned_write##bytes(void* p) { Record(p, bytes, true, false); }
ROMAP_TSAN_ACCESS(1)
ROMAP_TSAN_ACCESS(2)
ROMAP_TSAN_ACCESS(4)
ROMAP_TSAN_ACCESS(8)
ROMAP_TSAN_ACCESS(16)

#define ROMAP_TSAN_UPDATE(bits, T, name)                        \
  T __tsan_atomic##bits##_##name(volatile T* p, T value, int) { \
    Record(p, sizeof(T), true, true);                           \
    return __atomic_##name(p, value, __ATOMIC_SEQ_CST);         \
  }
#define ROMAP_TSAN_COMPARE(bits, T, strength, weak)                                                      \
  int __tsan_atomic##bits##_compare_exchange_##strength(volatile T* p, T* expected, T value, int, int) { \
    Record(p, sizeof(T), true, true);                                                                    \
    return __atomic_compare_exchange_n(p, expected, value, weak, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);    \
  }
#define ROMAP_TSAN_ATOMIC(bits, T)                                                               \
  T __tsan_atomic##bits##_load(const volatile T* p, int) {                                       \
    Record(p, sizeof(T), false, true);                                                           \
    return __atomic_load_n(p, __ATOMIC_SEQ_CST);                                                 \
  }                                                                                              \
  void __tsan_atomic##bits##_store(volatile T* p, T value, int) {                                \
    Record(p, sizeof(T), true, true);                                                            \
    __atomic_store_n(p, value, __ATOMIC_SEQ_CST);                                                \
  }                                                                                              \
  T __tsan_atomic##bits##_exchange(volatile T* p, T value, int) {                                \
    Record(p, sizeof(T), true, true);                                                            \
    return __atomic_exchange_n(p, value, __ATOMIC_SEQ_CST);                                      \
  }                                                                                              \
  T __tsan_atomic##bits##_compare_exchange_val(volatile T* p, T expected, T value, int, int) {   \
    Record(p, sizeof(T), true, true);                                                            \
    __atomic_compare_exchange_n(p, &expected, value, false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST); \
    return expected;                                                                             \
  }                                                                                              \
  ROMAP_TSAN_COMPARE(bits, T, strong, false)                                                     \
  ROMAP_TSAN_COMPARE(bits, T, weak, true)                                                        \
  ROMAP_TSAN_UPDATE(bits, T, fetch_add)                                                          \
  ROMAP_TSAN_UPDATE(bits, T, fetch_sub)                                                          \
  ROMAP_TSAN_UPDATE(bits, T, fetch_and)                                                          \
  ROMAP_TSAN_UPDATE(bits, T, fetch_or)                                                           \
  ROMAP_TSAN_UPDATE(bits, T, fetch_xor)
ROMAP_TSAN_ATOMIC(8, uint8_t)
ROMAP_TSAN_ATOMIC(16, uint16_t)
ROMAP_TSAN_ATOMIC(32, uint32_t)
ROMAP_TSAN_ATOMIC(64, uint64_t)

}  // extern "C"
