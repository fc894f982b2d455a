#pragma once

// A copy of a recorded sequence that tests change in the ways in which recordings differ in practice.

#include <cstddef>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "client/files/tum.h"

namespace romap::testing_support {

class Recording {
 public:
  // Copies the lists of the sequence in `source` to the new folder `dir`. Folders of images are linked until they are
  // changed.
  Recording(const std::string& source, const std::string& dir);

  const std::string& dir() const { return dir_; }
  std::string Path(const std::string& name) const { return dir_ + "/" + name; }

  std::string Read(const std::string& name) const;
  void Write(const std::string& name, std::string_view bytes) const;
  // Replaces every match of a regular expression, ^ and $ per line.
  void Replace(const std::string& name, const std::string& pattern, const std::string& text) const;
  void Remove(const std::string& name) const;

  // The files in an image folder ("rgb", "mask" or "depth"), sorted by name.
  std::vector<std::string> Files(const std::string& kind) const;
  // Replaces the link to an image folder by a copy whose files may be changed.
  void Own(const std::string& kind) const;
  // Replaces every image of a folder by change(image, index). Reads and writes the stored pixels.
  using ImageChange = std::function<cv::Mat(cv::Mat, size_t)>;
  void ChangeImages(const std::string& kind, const ImageChange& change) const;

  // Timestamps of mask.txt as text.
  std::vector<std::string> Stamps() const;
  // Adds a detection with this label and class to every frame.
  void AddDetections(int label, const std::string& class_name) const;

  std::vector<files::StampedPose> Poses() const;
  void WritePoses(const std::vector<files::StampedPose>& poses) const;

 private:
  std::string dir_;
};

}  // namespace romap::testing_support
