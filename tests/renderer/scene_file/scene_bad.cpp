/// Bad scene files: each says where and what. The place is that of the value, or of the unknown key.
#include <gtest/gtest.h>

#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using test::BadFile;
using test::MemoryFolder;

// What a case does not bring itself comes after it, so that places stay.
std::string completed(std::string text) {
    if (text.find("[sun]") == text.npos && text.find("[ambient]") == text.npos)
        text += "\n[ambient]\nradiance = 1\n";
    if (text.find("body") == text.npos) text += "\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1}\n";
    if (text.find("camera") == text.npos && text.find("lidar") == text.npos)
        text += "\n[[camera]]\nname = \"c\"\nresolution = [64, 48]\nfov_diagonal_deg = 30\n";
    return text;
}

#define CAMERA "[[camera]]\nname = \"c\"\nresolution = [64, 48]\n"
#define BODY "[[body]]\nname = \"x\"\n"
#define BALL BODY "sphere = {radius_m = 1}\n"
#define TAG(name)                   \
    "[[body.mark]]\nname = \"" name \
    "\"\nkind = \"tag\"\nposition_m = [1, 0, 0]\nside_m = 1\nattitude_wxyz = [1, 0, 0, 0]\n"
#define PLANET BODY "sphere = {radius_m = 6371000}\n"
#define FIELD "fov_diagonal_deg = 9\n"
#define LIDAR "[[lidar]]\nname = \"l\"\n"

const BadFile kBad[] = {
    {"TomlSyntax", "[scene\nname = 1\n", 1, 7, "table header"},
    {"TomlUnclosedText", "[scene]\nname = \"abc\n", 2, 12, "string"},
    {"DuplicateKey", "[render]\nspp = 1\nspp = 2\n", 3, 7, "spp"},
    {"UnknownTable", "[snu]\ndirection = [1, 0, 0]\n", 1, 2,
     "unknown key \"snu\" in the scene; did you mean \"sun\"?"},
    {"UnknownKey", "[sun]\ndirectoin = [1, 0, 0]\n", 2, 1, "unknown key \"directoin\" in [sun]"},
    {"UnknownKeyInBody", BALL "albdeo = 1\n", 4, 1, "unknown key \"albdeo\" in [[body]]"},
    {"MarkOfNoKind", BALL "[[body.mark]]\nname = \"m\"\nposition_m = [1, 0, 0]\nkind = \"led\"\n", 7, 8, "led"},
    {"MarkWithoutRadius", BALL "[[body.mark]]\nname = \"m\"\nposition_m = [1, 0, 0]\nkind = \"lamp\"\n", 4, 1,
     "radius_m"},
    {"MarkWithKeysOfATag",
     BALL "[[body.mark]]\nname = \"m\"\nposition_m = [1, 0, 0]\nkind = \"lamp\"\nradius_m = 1\nid = 3\n", 9, 6,
     "id"},
    {"TagOfNoDictionary", BALL TAG("t") "id = 0\ndictionary = \"36h11\"\n", 11, 14, "36h11"},
    {"TagBeyondItsDictionary", BALL TAG("t") "dictionary = \"4X4_50\"\nid = 50\n", 11, 6,
     "50 is not in 4X4_50, expected 0 to 49"},
    {"TwoTagsOfOneNumber",
     BALL TAG("t") "dictionary = \"4X4_50\"\nid = 5\n" TAG("u") "dictionary = \"4X4_50\"\nid = 5\n", 19, 6,
     "5 is the number of mark \"t\""},
    {"UnknownKeyInMaterial", BALL "material = {albdeo = 0.5}\n", 4, 13, "did you mean \"albedo\"?"},
    {"UnknownKeyInDetector", CAMERA "fov_diagonal_deg = 9\n[camera.detector]\nbitz = 8\n", 6, 1,
     "did you mean \"bits\"?"},
    {"DetectorAlone", "[detector]\nexposure_s = 0.01\n", 1, 1,
     "detector: belongs to a camera, expected [camera.detector] after its [[camera]]"},
    {"ExposureBesideTheDetector", CAMERA FIELD "exposure_s = 0.01\n", 5, 14, "expected it in [camera.detector]"},
    {"FieldOfViewByAnotherName", CAMERA "fov_deg = 40\n", 4, 1,
     "unknown key \"fov_deg\" in [[camera]]; did you mean \"fov_horizontal_deg\" or \"fov_diagonal_deg\"?"},
    {"BasedOnAtTheTop", "based_on = \"other.toml\"\n[scene]\nname = \"x\"\n", 1, 1,
     "based_on: belongs to [scene], expected it there"},
    {"BasedOnAfterAnotherTable", "[scene]\nname = \"x\"\n[render]\nspp = 1\nbased_on = \"o.toml\"\n", 5, 1,
     "based_on: belongs to [scene]"},
    {"BasedOnInAListOfTables", BALL "based_on = \"other.toml\"\n", 4, 1, "based_on: belongs to [scene]"},
    {"FormatOfALinkWithoutADetector", CAMERA FIELD "format = \"Y12\"\n", 5, 10,
     "Y12 has pixels of 12 bits, expected a [camera.detector] with bits = 12"},
    {"FormatOfALinkWithOtherBits",
     CAMERA FIELD "format = \"Y10P\"\n[camera.detector]\nexposure_s = 0.01\nbits = 12\n", 5, 10,
     "Y10P has pixels of 10 bits, expected a [camera.detector] with bits = 10"},
    {"PackedOddWidth",
     "[[camera]]\nname = \"c\"\nresolution = [66, 48]\nfov_diagonal_deg = 9\nformat = \"RGGB10P\"\n", 5, 10,
     "RGGB10P holds 4 pixels together, expected a width that is a multiple of 4, not 66"},
    {"PixelFormatOfRos", CAMERA FIELD "format = \"bayer_rggb8\"\n", 5, 10, "did you mean \"RGGB8\"?"},
    {"OtherUnit", CAMERA "fov_horizontal_rad = 1\n", 4, 1,
     "unknown key \"fov_horizontal_rad\" in [[camera]]; did you mean \"fov_horizontal_deg\"?"},
    {"OtherNotation", BALL "attitude_deg = [0, 0, 0]\n", 4, 1,
     "unknown key \"attitude_deg\" in [[body]]; did you mean \"attitude_wxyz\"?"},
    {"UnknownFarFromAll", "[render]\nphotons = 3\n", 2, 1, "unknown key \"photons\" in [render]"},
    {"WrongType", "[render]\nspp = \"four\"\n", 2, 7, "spp: got a text, expected an integer in [1, 65535]"},
    {"FloatForInteger", "[render]\nspp = 4.0\n", 2, 7, "spp: got 4, expected an integer"},
    {"NegativeSeed", "[render]\nseed = -1\n", 2, 8, "seed: got -1"},
    {"MethodUnknown", "[render]\nmethod = \"photons\"\n", 2, 10, "expected one of \"direct\", \"path\""},
    {"DepthOfDirectLight", "[render]\nmax_depth = 3\n", 2, 13,
     "belongs to method = \"path\", and this is \"direct\""},
    {"DepthZero", "[render]\nmethod = \"path\"\nmax_depth = 0\n", 3, 13, "got 0, expected an integer in [1, 40]"},
    {"DepthTooMuch", "[render]\nmethod = \"path\"\nmax_depth = 41\n", 3, 13, "got 41"},
    {"BudgetZero", "[render]\nbudget_ms = 0\n", 2, 13, "budget_ms: got 0, expected"},
    {"BudgetRaysZero", "[render]\nbudget_rays = 0\n", 2, 15, "budget_rays: got 0, expected an integer in [1, "},
    {"BudgetAndSpp", "[render]\nspp = 4\nbudget_ms = 10\n", 3, 13, "expected one of spp, budget_ms, budget_rays"},
    {"BudgetOfTwoKinds", "[render]\nbudget_rays = 4\nbudget_ms = 10\n", 2, 15, "budget_ms is given too"},
    {"BudgetBeyondAPeriod", "[render]\nbudget_ms = 101\n" CAMERA FIELD "rate_hz = 10\n", 7, 11,
     "rate_hz: a period of 100 ms, expected at least the budget_ms of [render], 101"},
    {"TableExpected", "sun = 3\n", 1, 7, "sun: got 3, expected a table"},
    {"ArrayOfTablesExpected", "[body]\nname = \"b\"\n", 1, 1, "headed [[body]]"},
    {"AirWithoutBody", "[atmosphere]\nturbidity = 2\n", 1, 1, "[atmosphere] has no \"body\""},
    {"AirOfNoBody", "[atmosphere]\nbody = \"earth\"\n" BALL, 2, 8, "there is no body \"earth\""},
    {"AirOfASmallBody", "[atmosphere]\nbody = \"x\"\n" BALL, 2, 8, "expected a planet, of 1e5 to 1e9 m"},
    {"AirOfNoPlanet", "[atmosphere]\nbody = \"x\"\nplanet = \"venus\"\n" PLANET, 3, 10,
     "\"venus\" is not known here"},
    {"AirTooTurbid", "[atmosphere]\nbody = \"x\"\nturbidity = 11\n" PLANET, 3, 13, "got 11, expected a number"},
    {"AirWithMarsDust", "[atmosphere]\nbody = \"x\"\ndust_depth = 1\n" PLANET, 3, 14,
     "belongs to planet = \"mars\""},
    {"AirUnknownKey", "[atmosphere]\nbody = \"x\"\nheight_m = 1\n" PLANET, 3, 1, "unknown key \"height_m\""},
    {"SkyWithoutModel", "[sky]\n[sun]\ndirection = [0, 0, 1]\n", 1, 1, "[sky] has no \"model\""},
    {"SkyWithoutSun", "[sky]\nmodel = \"hosek-wilkie\"\n[ambient]\nradiance = 1\n", 1, 1, "expected a [sun]"},
    {"SkyAtNight", "[sky]\nmodel = \"hosek-wilkie\"\n[sun]\ndirection = [0, 0, -1]\n", 1, 1,
     "below this sky's horizon"},
    {"SkyAndAmbient", "[sky]\nmodel = \"hosek-wilkie\"\n[sun]\ndirection = [0, 0, 1]\n[ambient]\nradiance = 1\n", 5,
     1, "the scene has a [sky] too"},
    {"ObserverWithoutTime", "[observer]\nlatitude_deg = 1\nlongitude_deg = 2\n", 1, 1, "expected an \"epoch\""},
    {"ObserverWithoutPlace", "[scene]\nepoch = 2026-01-01T00:00:00Z\n[observer]\nlatitude_deg = 1\n", 3, 1,
     "has no \"longitude_deg\""},
    {"TrackWithoutObserver", CAMERA FIELD "track = \"sun\"\n", 5, 9, "expected an [observer]"},
    {"OrbitAndPosition", BALL "position_m = [1, 2, 3]\norbit = {semi_major_axis_m = 7e6}\n", 4, 14,
     "the body has an orbit"},
    {"OrbitUnbound", BALL "orbit = {semi_major_axis_m = 7e6, eccentricity = 1}\n", 4, 50, "got 1"},
    {"SunWithoutDirection", "[sun]\nirradiance_w_m2 = 1\n", 1, 1, "[sun] has no \"direction\""},
    {"SunDirectionZero", "[sun]\ndirection = [0, 0, 0]\n", 2, 13, "of any length but 0"},
    {"UpZero", CAMERA "fov_diagonal_deg = 9\nlook_at = [1, 0, 4]\nup = [0, 0, 0]\n", 5, 11, "lies along up"},
    {"SunDirectionOfTwo", "[sun]\ndirection = [1, 0]\n", 2, 13,
     "got an array of 2, expected an array of 3 numbers"},
    {"SunDirectionNaN", "[sun]\ndirection = [1, nan, 0]\n", 2, 17,
     "direction[1]: got nan, expected a finite number"},
    {"NegativeIrradiance", "[sun]\ndirection = [1, 0, 0]\nirradiance_w_m2 = -3\n", 3, 19,
     "got -3, expected a number > 0"},
    {"EpochNotADate", "[scene]\nepoch = \"yesterday\"\n", 2, 9, "expected a UTC date and time"},
    {"EpochFarFuture", "[scene]\nepoch = 2500-01-01T00:00:00Z\n", 2, 9, "1900 to 2099"},
    {"AmbientNegative", "[ambient]\nradiance = [1, 2, -1]\n", 2, 19, "radiance[2]: got -1"},
    {"AmbientEmpty", "[ambient]\n", 1, 1, "has no \"radiance\""},

    {"NoBody", "[scene]\nname = \"no b0dies\"\n" LIDAR "model = \"VLP-16\"\n#body\n", 1, 1, "has no \"body\""},
    {"BodyWithoutName", "[[body]]\nsphere = {radius_m = 1}\n", 1, 1, "[[body]] has no \"name\""},
    {"BodyNameWithSpace", "[[body]]\nname = \"a b\"\nsphere = {radius_m = 1}\n", 2, 8, "letters, digits"},
    {"BodyNameTwice", BALL BALL, 5, 8, "\"x\" is the name of another [[body]]"},
    {"BodyWithoutShape", BODY, 1, 1, "expected mesh = \"FILE\" or sphere"},
    {"BodyOfTwoShapes", BALL "mesh = \"a.obj\"\n", 3, 10, "this body has a mesh already, expected one of the two"},
    {"EllipsoidNotATable", BODY "ellipsoid = [1, 2, 3]\n", 3, 13, "ellipsoid: got an array, expected a table"},
    {"EllipsoidWithoutAxes", BODY "ellipsoid = {}\n", 3, 13, "ellipsoid has no \"semi_axes_m\""},
    {"EllipsoidFlat", BODY "ellipsoid = {semi_axes_m = [1, 2, 0]}\n", 3, 35,
     "semi_axes_m[2]: got 0, expected a number in (0"},
    {"EllipsoidOfTwo", BODY "ellipsoid = {semi_axes_m = [1, 2]}\n", 3, 28, "expected an array of 3 numbers"},
    {"SphereAndEllipsoid", BALL "ellipsoid = {semi_axes_m = [1, 2, 3]}\n", 4, 13, "has a sphere already"},
    {"DemWithoutFile", BODY "dem = {error_px = 1}\n", 3, 7, "dem has no \"file\", expected the name of a DEM"},
    {"DemUnknownKey", BODY "dem = {file = \"a.tif\", tile = 1}\n", 3, 24, "unknown key \"tile\""},
    {"DemPath", BODY "dem = {file = \"a.tif\", seen_from_m = [[0, 0]]}\n", 3, 38, "expected [[x, y, z], ...]"},
    {"DemGround", BODY "dem = {file = \"a.tif\", on = \"sea\"}\n", 3, 29, "expected one of \"plane\""},
    {"RotationWithoutEpoch", BALL "rotation = \"mars\"\n", 4, 12, "expected an epoch in [scene]"},
    {"DemWithMoreCratersThanAreDrawn", BODY "dem = {file = \"a.tif\", detail = {posts = 2, craters_per_m2 = 2}}\n",
     3, 62, "got 2, expected a number"},
    {"DemMissing", BODY "dem = \"nowhere.tif\"\n", 3, 7, "nowhere.tif: no such file"},
    {"SphereWithoutRadius", BODY "sphere = {}\n", 3, 10, "has no \"radius_m\""},
    {"SphereRadiusZero", BODY "sphere = {radius_m = 0}\n", 3, 22, "got 0, expected a number in (0"},
    {"SphereRadiusInfinite", BODY "sphere = {radius_m = inf}\n", 3, 22, "radius_m: got inf"},
    {"SphereScaled", BALL "scale = 2\n", 4, 9, "belongs to a mesh"},
    {"ScaleZero", BODY "mesh = \"a.obj\"\nscale = 0\n", 4, 9, "scale: got 0"},
    {"MeshMissing", BODY "mesh = \"nowhere.obj\"\n", 3, 8, "nowhere.obj: no such file"},
    {"MeshIsAFolder", BODY "mesh = \".\"\n", 3, 8, "not a plain file"},
    {"TextureMissing", BALL "material = {texture = \"no.png\"}\n", 4, 23, "no.png: no such file"},
    {"PositionOfTexts", BALL "position_m = [\"a\", 0, 0]\n", 4, 15, "position_m[0]: got a text"},
    {"AttitudeNotUnit", BALL "attitude_wxyz = [1, 1, 0, 0]\n", 4, 17, "norm is 1.41421, expected 1"},
    {"AttitudeZero", BALL "attitude_wxyz = [0, 0, 0, 0]\n", 4, 17, "norm is 0"},
    {"AttitudeOfThree", BALL "attitude_wxyz = [1, 0, 0]\n", 4, 17, "expected an array of 4 numbers"},
    {"CanIdOdd", BALL "can_id = 0x105\n", 4, 10, "0x105 is not a base identifier, expected a multiple of 16"},
    {"CanIdTooHigh", BALL "can_id = 0x600\n", 4, 10, "got 0x600, expected an integer in [0x0, 0x5f0]"},
    {"CanIdTwice", BALL "can_id = 0x20\n[[body]]\nname = \"y\"\nsphere = {radius_m = 1}\ncan_id = 32\n", 8, 10,
     "0x020 is taken by body \"x\""},
    {"NoSensor", BALL "# no c4mera, no l1dar: camera\n", 1, 1, "at least one [[camera]] or [[lidar]]"},
    {"CameraNameTwice", CAMERA "fov_diagonal_deg = 9\n" CAMERA "fov_diagonal_deg = 9\n", 6, 8,
     "another [[camera]]"},
    {"CameraWithoutProjection", CAMERA, 1, 1, "one of intrinsics, fov_diagonal_deg, fov_horizontal_deg"},
    {"CameraOfTwoProjections", CAMERA "fov_diagonal_deg = 9\nfov_horizontal_deg = 9\n", 4, 20,
     "expected exactly one of"},
    {"CameraWithoutResolution", "[[camera]]\nname = \"c\"\nfov_diagonal_deg = 9\n", 1, 1, "has no \"resolution\""},
    {"ResolutionOfOne", "[[camera]]\nname = \"c\"\nresolution = [64]\nfov_diagonal_deg = 9\n", 3, 14,
     "[width, height]"},
    {"ResolutionNegative", "[[camera]]\nname = \"c\"\nresolution = [64, -2]\nfov_diagonal_deg = 9\n", 3, 14,
     "[1, 16384]"},
    {"FieldOfViewHalfTurn", CAMERA "fov_diagonal_deg = 180\n", 4, 20, "expected a number in (0, 180)"},
    {"IntrinsicsWithoutFy", CAMERA "intrinsics = {fx = 100}\n", 4, 14, "has no \"fy\""},
    {"DistortionIsATable", CAMERA "fov_diagonal_deg = 9\ndistortion = [0.1]\n", 5, 14, "expected a table"},
    {"DistortionModel", CAMERA FIELD "distortion = {model = \"fov\", coefficients = [0, 0, 0, 0]}\n", 5, 23,
     "expected one of \"opencv\", \"fisheye\""},
    {"DistortionOfSix", CAMERA FIELD "distortion = {model = \"opencv\", coefficients = [0, 0, 0, 0, 0, 0]}\n", 5,
     48, "got an array of 6, expected an array of 4, 5, 8, 12 numbers"},
    {"FisheyeOfFive", CAMERA FIELD "distortion = {model = \"fisheye\", coefficients = [0, 0, 0, 0, 0]}\n", 5, 49,
     "got an array of 5, expected an array of 4 numbers"},
    {"DistortionFolds",
     CAMERA "fov_diagonal_deg = 120\ndistortion = {model = \"opencv\", coefficients = [-0.35, 0, 0, 0]}\n", 4, 20,
     "the lens does not see 120 degrees"},
    {"ControlWithoutDetector", CAMERA FIELD "control = {latency_s = 0.01}\n", 5, 24,
     "expected a [camera.detector]"},
    {"ControlUnknownTrigger", CAMERA FIELD "detector = {}\ncontrol = {trigger = \"often\"}\n", 6, 22,
     "expected one of \"free_running\", \"command\", \"sync\""},
    {"ControlTooQuick", CAMERA FIELD "detector = {}\ncontrol = {latency_s = 0}\n", 6, 24,
     "expected a number in [0.001, 10]"},
    {"ShutterWithoutDetector", CAMERA FIELD "shutter = {kind = \"global\"}\n", 5, 19,
     "expected a [camera.detector]"},
    {"ShutterUnknown", CAMERA FIELD "detector = {}\nshutter = {kind = \"leaf\"}\n", 6, 19,
     "expected one of \"global\", \"rolling\""},
    {"ShutterWithoutRowTime", CAMERA FIELD "detector = {}\nshutter = {kind = \"rolling\"}\n", 6, 11,
     "the time from one row's start"},
    {"ShutterTooSlow", CAMERA FIELD "detector = {}\nshutter = {kind = \"rolling\", row_time_s = 0.01}\n", 6, 43,
     "expected less than 1 / rate_hz = 0.1 s"},
    {"PsfOfNothing", CAMERA FIELD "psf = {}\n", 5, 7,
     "a Gaussian's standard deviation, or wavelength_m, or an image"},
    {"PsfTooWide", CAMERA FIELD "psf = {sigma_px = 9}\n", 5, 19, "expected a number in (0, 8]"},
    {"PsfWithoutDetector", CAMERA FIELD "psf = {wavelength_m = 5.5e-7}\n", 5, 23, "expected a [camera.detector]"},
    {"PsfImageMissing", CAMERA FIELD "psf = {image = \"none.png\"}\n", 5, 16, "none.png: no such file"},
    {"PsfSamplesOfNoImage", CAMERA FIELD "psf = {sigma_px = 1, samples_per_px = 2}\n", 5, 39, "there is no image"},
    {"PsfTooFewSamples", CAMERA FIELD "psf = {samples_per_px = 0.5, image = \"none.png\"}\n", 5, 25,
     "got 0.5, expected a number in [1, 64]"},
    {"VignettingOfNothing", CAMERA FIELD "vignetting = {}\n", 5, 14, "true, or a polynomial"},
    {"VignettingOfFour", CAMERA FIELD "vignetting = {polynomial = [0, 0, 0, 0]}\n", 5, 28,
     "expected an array of 1, 2, 3 numbers"},
    {"VeilingGlareOfAll", CAMERA FIELD "veiling_glare = 1\n", 5, 17, "expected a number in [0, 1)"},
    {"GhostWithoutSun", CAMERA FIELD "ghost = {strength = 1e-4, radius_px = 9, within_deg = 20}\n", 5, 21,
     "there is no Sun, expected a [sun]"},
    {"GhostFromBehind", "[sun]\ndirection = [1, 0, 0]\n" CAMERA FIELD "ghost = {within_deg = 90}\n", 7, 23,
     "expected a number in (0, 89]"},
    {"GhostWithoutRadius",
     "[sun]\ndirection = [1, 0, 0]\n" CAMERA FIELD "ghost = {strength = 1e-4, within_deg = 20}\n", 7, 9,
     "the radius of the disc"},
    {"TwoFNumbers",
     CAMERA FIELD "detector = {f_number = 2}\nlens = {focal_length_m = 0.05, f_number = 4, focus_distance_m = 9}\n",
     6, 43, "the detector's is 2, expected the same"},
    {"CalibrationMissing", CAMERA "calibration = \"none.yaml\"\n", 4, 15, "none.yaml: cannot be read"},
    {"YuyvOddWidth", "[[camera]]\nname = \"c\"\nresolution = [63, 48]\nfov_diagonal_deg = 9\nformat = \"YUYV\"\n",
     5, 10, "YUYV needs an even width, not 63"},
    {"MosaicOddHeight",
     "[[camera]]\nname = \"c\"\nresolution = [64, 47]\nfov_diagonal_deg = 9\nformat = \"RGGB8\"\n", 5, 10,
     "RGGB8 needs an even height, not 47"},
    {"FormatUnknown", CAMERA "fov_diagonal_deg = 9\nformat = \"BGR3\"\n", 5, 10,
     "expected one of \"GREY\", \"Y16\""},
    {"LatePolicyUnknown", CAMERA "fov_diagonal_deg = 9\nlate_policy = \"wait\"\n", 5, 15, "\"drop\", \"repeat\""},
    {"RateZero", CAMERA "fov_diagonal_deg = 9\nrate_hz = 0\n", 5, 11, "rate_hz: got 0"},
    {"ExposureLongerThanFrame", CAMERA "fov_diagonal_deg = 9\ndetector = {exposure_s = 0.2}\n", 5, 26,
     "longer than a frame"},
    {"ExposureStopsLongerThanFrame", CAMERA FIELD "detector = {exposure_s = 0.02, exposure_stops = 3}\n", 5, 26,
     "0.16 s is longer than a frame, expected at most 1 / rate_hz = 0.1 s"},
    {"ExposureStopsTooMany", CAMERA FIELD "detector = {exposure_stops = 21}\n", 5, 30, "a number in [-20, 20]"},
    {"DetectorBits", CAMERA "fov_diagonal_deg = 9\ndetector = {bits = 17}\n", 5, 20,
     "expected an integer in [8, 16]"},
    {"DarkCurrentNegative", CAMERA FIELD "detector = {dark_current_e_s = -1}\n", 5, 32,
     "got -1, expected a number >= 0"},
    {"ColderThanAbsoluteZero", CAMERA FIELD "detector = {temperature_c = -300}\n", 5, 29, "got -300"},
    {"DarkReferenceTooHot", CAMERA FIELD "detector = {dark_reference_c = 400}\n", 5, 32, "got 400"},
    {"DarkDoublingZero", CAMERA FIELD "detector = {dark_doubling_c = 0}\n", 5, 31, "a number in [1, 100]"},
    {"PrnuInPercent", CAMERA FIELD "detector = {prnu = 1.5}\n", 5, 20, "got 1.5, expected a number in [0, 0.5]"},
    {"DsnuNaN", CAMERA FIELD "detector = {dsnu_e = nan}\n", 5, 22, "got nan"},
    {"DeadPixelShare", CAMERA FIELD "detector = {dead_pixel_share = 0.2}\n", 5, 32, "a number in [0, 0.1]"},
    {"HotPixelsWithoutCurrent", CAMERA FIELD "detector = {hot_pixel_share = 0.01}\n", 5, 12,
     "detector has no \"hot_pixel_e_s\""},
    {"HotPixelCurrentAlone", CAMERA FIELD "detector = {hot_pixel_e_s = 10}\n", 5, 29,
     "there is no hot_pixel_share"},
    {"HotPixelCurrentZero", CAMERA FIELD "detector = {hot_pixel_share = 0.01, hot_pixel_e_s = 0}\n", 5, 53,
     "got 0, expected a number > 0"},
    {"BlinkingWithoutCurrent", CAMERA FIELD "detector = {blinking_pixel_share = 0.01}\n", 5, 12,
     "detector has no \"blinking_e_s\""},
    {"BlinkingShare", CAMERA FIELD "detector = {blinking_pixel_share = -1, blinking_e_s = 9}\n", 5, 36, "got -1"},
    {"BloomingNumber", CAMERA FIELD "detector = {blooming = 1}\n", 5, 24, "expected true or false"},
    {"CosmicRaysTooMany", CAMERA FIELD "detector = {cosmic_rays_per_cm2_s = 1e7}\n", 5, 37, "got 1"},
    {"SensitiveDepthZero", CAMERA FIELD "detector = {sensitive_depth_m = 0}\n", 5, 33,
     "got 0, expected a number in (0, 0.01]"},
    {"BlackLevelAboveFullScale", CAMERA "fov_diagonal_deg = 9\ndetector = {bits = 8, black_level_dn = 255}\n", 5,
     40, "expected an integer in [0, 254]"},
    {"ShotNoiseNumber", CAMERA "fov_diagonal_deg = 9\ndetector = {shot_noise = 1}\n", 5, 26,
     "expected true or false"},
    {"MountUnknown", CAMERA "fov_diagonal_deg = 9\nmount = \"ship\"\n", 5, 9,
     "there is no body \"ship\", expected one of \"b\""},
    {"LookAtItself", CAMERA "fov_diagonal_deg = 9\nposition_m = [1, 2, 3]\nlook_at = [1, 2, 3]\n", 6, 11,
     "another point"},
    {"LookAtAlongUp", CAMERA "fov_diagonal_deg = 9\nlook_at = [0, 0, 4]\n", 5, 11, "lies along up"},
    {"LookAtAndAttitude", CAMERA "fov_diagonal_deg = 9\nlook_at = [4, 0, 0]\nattitude_wxyz = [1, 0, 0, 0]\n", 5, 11,
     "one of the two"},
    {"UpAlone", CAMERA "fov_diagonal_deg = 9\nup = [4, 0, 0]\n", 5, 6, "belongs to look_at"},
    {"NoWhite", BALL CAMERA "fov_diagonal_deg = 9\n[ambient]\nradiance = 0\n", 4, 1, "has no \"white_radiance\""},
    {"LensWithoutAperture", CAMERA FIELD "lens = {focus_distance_m = 3}\n", 5, 8,
     "lens has no \"aperture_diameter_m\", expected a number > 0, or focal_length_m and f_number"},
    {"LensWithoutFocus", CAMERA FIELD "lens = {aperture_diameter_m = 0.1}\n", 5, 8,
     "has no \"focus_distance_m\", expected a number > 0, or inf"},
    {"LensWithoutFNumber", CAMERA FIELD "lens = {focal_length_m = 0.1, focus_distance_m = 3}\n", 5, 8,
     "has no \"f_number\""},
    {"LensOfTwoApertures", CAMERA FIELD "lens = {aperture_diameter_m = 0.1, f_number = 2, focus_distance_m = 3}\n",
     5, 47, "f_number: there is an aperture_diameter_m already"},
    {"LensFocusNegative", CAMERA FIELD "lens = {aperture_diameter_m = 0.1, focus_distance_m = -1}\n", 5, 55,
     "got -1, expected a number > 0, or inf"},
    {"LensFocusNotANumber", CAMERA FIELD "lens = {aperture_diameter_m = 0.1, focus_distance_m = nan}\n", 5, 55,
     "got nan"},
    {"LensFocusTooNear", CAMERA FIELD "lens = {focal_length_m = 0.1, f_number = 2, focus_distance_m = 0.05}\n", 5,
     64, "got 0.05, expected more than the focal length of 0.1 m"},
    {"LensAperture", CAMERA FIELD "lens = {aperture_diameter_m = inf, focus_distance_m = 1}\n", 5, 31,
     "got inf, expected a number > 0"},
    {"LensOfAFisheye", CAMERA "fov_diagonal_deg = 175\nlens = {aperture_diameter_m = 0.01, focus_distance_m = 9}\n",
     5, 8, "the image reaches 87 degrees off the axis, expected at most 80 for a thin lens"},
    {"LidarModel", LIDAR "model = \"HDL-64\"\n", 3, 9, "expected one of \"VLP-16\""},
    {"LidarWithoutModel", LIDAR, 1, 1, "[[lidar]] has no \"model\""},
    {"LidarTooFast", LIDAR "model = \"VLP-16\"\nrate_hz = 25\n", 4, 11, "got 25, expected a number in [5, 20]"},
    {"LidarFewSubRays", LIDAR "model = \"VLP-16\"\nbeam_divergence_rad = 3e-3\nsub_rays = 4\n", 5, 12,
     "4 is too few, expected 1, or 8 to 64"},
    {"LidarSubRaysOfALine", LIDAR "model = \"VLP-16\"\nsub_rays = 32\n", 1, 1, "has no \"beam_divergence_rad\""},
    {"LidarMultipath", LIDAR "model = \"VLP-16\"\nmultipath = \"all\"\n", 4, 13, "expected one of \"none\""},
    {"LidarMultipathOfALine", LIDAR "model = \"VLP-16\"\nmultipath = \"diffuse\"\n", 4, 13,
     "expected a beam_divergence_rad, or a model whose [grid] is a flash"},
    {"LidarNoise", LIDAR "model = \"VLP-16\"\nrange_noise_m = -0.1\n", 4, 17, "expected a number in [0, 1000]"},
    {"LidarTooFar", LIDAR "model = \"VLP-16\"\nrange_max_m = 200\n", 4, 15, "expected a number in (0, 131.07]"},
    {"LidarRangesCrossed", LIDAR "model = \"VLP-16\"\nrange_max_m = 20\nrange_min_m = 50\n", 5, 15,
     "is 50, expected less than the largest range, 20"},
    {"LidarVelocityOfRanges", LIDAR "model = \"VLP-16\"\nvelocity_noise_m_s = 0.1\n", 4, 22,
     "a VLP-16 measures no velocity"},
    {"WhiteOfADetector", CAMERA FIELD "white_radiance = 3\ndetector = {bits = 8}\n", 5, 18,
     "belongs to cameras without a [camera.detector]"},
    {"FirstInTheFileIsTold", "[render]\nspp = 0\n[sun]\ndirection = [0, 0, 0]\n", 2, 7, "spp: got 0"},
};

class BadSceneFile : public testing::TestWithParam<BadFile> {};

TEST_P(BadSceneFile, SaysWhereAndWhat) {
    const BadFile& bad = GetParam();
    const MemoryFolder folder;
    const std::string path = folder.write("bad.toml", completed(bad.text));
    const Result<Scene> scene = read_scene(path);
    ASSERT_FALSE(scene) << completed(bad.text);
    expect_error_of(bad, path, scene.error());
}

INSTANTIATE_TEST_SUITE_P(Scene, BadSceneFile, testing::ValuesIn(kBad),
                         [](const auto& one) { return std::string(one.param.name); });

std::string times(int n, const std::string& text) {
    std::string out;
    for (int i = 0; i < n; ++i) out += text;
    return out;
}

TEST(SceneFile, NestingIsBoundedBeforeTheParser) {
    const MemoryFolder folder;
    const auto error_of = [&](const std::string& text) {
        const std::string path = folder.write("s.toml", text);
        const Result<Scene> scene = read_scene(path);
        return scene ? std::string() : scene.error().text().substr(path.size());
    };
    const std::string parts = ": a key of more than 32 parts, expected fewer dots",
                      levels = ": more than 32 arrays and tables inside one another, expected fewer";
    EXPECT_EQ(error_of("[scene]\n" + times(200'000, "a.") + "a = 1\n"), ":2:64" + parts);
    EXPECT_EQ(error_of("[" + times(200'000, "'a' . ") + "a]\n"), ":1:192" + parts);
    EXPECT_EQ(error_of("a = " + times(200'000, "[")), ":1:37" + levels);
    EXPECT_EQ(error_of(times(200'000, "a={")), ":1:99" + levels);
    EXPECT_EQ(error_of("x = [\"\"\"\"\"\"\"\"," + times(40, "a.") + "a]\n"), ":1:78" + parts);
    // Dots and brackets of texts and comments do not count.
    const std::string dots = times(40, "a.") + times(40, "[");
    EXPECT_EQ(error_of("# " + dots + "\n[scene]\nname = \"" + dots + "\"\n"),
              ":1:1: the scene has no \"body\", expected at least one [[body]]");
}

TEST(SceneFile, MissingFileIsBadInput) {
    const Result<Scene> scene = read_scene("/nowhere/at/all.toml");
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().text(), "/nowhere/at/all.toml: no such file");
    EXPECT_EQ(exit_status(scene.error().kind), 2);
}

TEST(SceneFile, MeshErrorNamesTheMeshsLineAndTheBody) {
    const MemoryFolder folder;
    const std::string mesh = folder.write("bad.obj", "v 0 0 0\nv 1 0 zero\n");
    const std::string path = folder.write("s.toml", completed(BODY "mesh = \"bad.obj\"\n"));
    const Result<Scene> scene = read_scene(path);
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().text(), mesh + ":2:7: \"zero\" is not a number (mesh of body \"x\", " + path + ":3)");
}

TEST(SceneFile, TextureNeedsCoordinatesOfTheMesh) {
    const MemoryFolder folder;
    folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("t.ppm", "P3 1 1 255\n9 9 9\n");
    const Result<Scene> scene =
        read_scene(folder.write("s.toml", completed(BODY "mesh = \"t.obj\"\nmaterial = {texture = \"t.ppm\"}\n")));
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().line, 4);
    EXPECT_NE(scene.error().what.find("no texture coordinates"), std::string::npos) << scene.error().what;
}

}  // namespace
}  // namespace narpa
