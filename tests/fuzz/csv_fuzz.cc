// Tables: detections of a sequence, and other files with separated values.

#include "client/files/csv.h"
#include "client/files/detections.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch_folder.h"

std::vector<std::string> romap::fuzz::Seeds() {
  return {"timestamp,label,class,score\n0.1,1,cup,0.9\n0.1,2,\"a \"\"big\"\", book\",0.8\n0.2,1,cup,1\n",
          "# no header\n1305031102.175,7,cup\n1305031102.275,7,cup\n",
          "1305031102175;7;cup;90\r\n1305031102275;7;cup;99\r\n1305031102275;7;cup;97\r\n",
          "\xEF\xBB\xBF"
          "0\t1\tcup\n1\t1\tcup\n2\t1\t\"two\nlines\"\n"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  const std::string path = folder.Write("detections.csv", fuzz::TextOf(data, size));
  (void)files::ReadCsv(path);
  const auto detections = files::ReadDetections(path);
  if (!detections.ok()) return 0;
  std::vector<int64_t> times_ns;
  for (const files::DetectionSet& set : detections->sets) {
    fuzz::Require(times_ns.empty() || times_ns.back() < set.timestamp_ns, "the times increase");
    times_ns.push_back(set.timestamp_ns);
    for (const Instance& instance : set.instances) {
      fuzz::Require(instance.score >= 0 && instance.score <= 1, "scores are 0..1");
    }
  }
  for (const int64_t max_dt_ns : {int64_t{0}, int64_t{20'000'000}}) {
    for (const int64_t set : files::MatchDetections(*detections, times_ns, max_dt_ns)) {
      fuzz::Require(set >= -1 && set < static_cast<int64_t>(times_ns.size()), "a match is a set");
    }
  }
  return 0;
}
