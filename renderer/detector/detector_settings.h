/// renderer/detector/detector_settings.h - a detector as a scene describes it: photons to digital numbers.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "base/pixel_format.h"

namespace narpa {

class DetectorStage;

/// What all detectors have, and the stages that this one has beside it. Amounts of 0 and switches that are false
/// are exactly off.
struct Detector {
    double exposure_s = 0.01;  ///< exposure stops included
    double pixel_pitch_m = 5e-6;
    double f_number = 4;
    double quantum_efficiency = 0.5;  ///< electrons per photon
    double full_well_e = 20000;
    double gain_e_per_dn = 0;  ///< 0: full_well_e / (2^bits - 1 - black_level_dn)
    double read_noise_e = 0;   ///< RMS
    bool shot_noise = false;   ///< Poisson
    int black_level_dn = 0;
    int bits = 12;  ///< ADC, 8..16
    double temperature_c = 20, dark_reference_c = 20;
    double dark_doubling_c = 7;  ///< temperature step, K, that doubles dark currents

    std::vector<std::shared_ptr<const DetectorStage>> stages{};  ///< detector_stage.h
};

/// The image sensor of a camera: all that its digital numbers follow from, beside light, seed and frame number.
struct ImageSensor {
    std::string_view name;  ///< of the camera: fixed patterns differ between cameras
    int width = 0, height = 0;
    PixelFormat format = PixelFormat::grey;
    double white_radiance = 0;           ///< without a detector: the radiance at full scale, W m^-2 sr^-1
    const Detector* detector = nullptr;  ///< null: an ideal sensor without noise
};

}  // namespace narpa
