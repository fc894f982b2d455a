#pragma once

#include "client/importers/recording_contents.h"
#include "client/importers/sequence_reader.h"

namespace romap::importers {

// Gives frames of a recording without times the times of ReadOptions::fps, and sets CameraYaml::fps.
void SetTimesByRate(const ReadOptions& options, RecordingContents* contents);

// Sets CameraYaml::fps from the median step of the times.
void SetRateByTimes(RecordingContents* contents);

// Sorts the frames by time and removes all but the first of those with the same time.
void SortByTime(RecordingContents* contents);

}  // namespace romap::importers
