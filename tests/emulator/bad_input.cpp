// What a user can get wrong, and the sentence and exit status that answer it: the program itself is run.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <utility>

#include "tests/emulator/loop_support.h"
#include "tests/support/command.h"
#include "tests/support/read_file.h"

namespace narpa::test {
namespace {

struct Mistake {
    const char* name;
    const char* arguments;  ///< SCENE, FOLDER and BAD stand for files
    const char* bad;        ///< content of the file BAD, if any
    int exit_status;
    const char* words;  ///< must be in the message
};

/// Names the case where GoogleTest would print its bytes.
void PrintTo(const Mistake& m, std::ostream* out) {
    *out << m.arguments;
}

class BadInput : public ::testing::TestWithParam<Mistake> {
protected:
    static std::string replaced(std::string text, const std::string& what, const std::string& with) {
        for (std::size_t at; (at = text.find(what)) != std::string::npos;) text.replace(at, what.size(), with);
        return text;
    }
    TemporaryFolder folder_;
};

TEST_P(BadInput, IsAnsweredWithASentenceAndAnExitStatus) {
    const Mistake& m = GetParam();
    std::ofstream(folder_ / "scene.toml") << small_scene();
    if (m.bad) std::ofstream(folder_ / "bad.toml") << replaced(m.bad, "GOOD", small_scene());
    std::string arguments = replaced(m.arguments, "SCENE", folder_ / "scene.toml");
    arguments = replaced(replaced(arguments, "BAD", folder_ / "bad.toml"), "FOLDER", folder_ / "");

    const std::string command = std::string(kTimeLimit) + NARPA_BIN + " " + arguments + " 2>&1 >/dev/null";
    const auto [status, said] = run_command(command);
    EXPECT_EQ(status, m.exit_status) << said;
    EXPECT_NE(said.find(m.words), std::string::npos) << "expected: " << m.words << "\nsaid: " << said;
}

constexpr const char* kHeader =
    "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n0,b,0,0,x,1,0,0,0,0,0,0,0,0,"
    "0\n";

constexpr const char* kFlight =
    "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n0,chaser,0,0,1,1,0,0,0,0,0,"
    "0,0,0,"
    "0\n";

INSTANTIATE_TEST_SUITE_P(
    All, BadInput,
    ::testing::Values(
        // Scenes and meshes
        Mistake{"NoScene", "check FOLDERnone.toml", nullptr, 2, "none.toml: "},
        Mistake{"SceneIsNoToml", "check BAD", "[scene\nname = 3", 2, "bad.toml:1:"},
        Mistake{"UnknownKey", "check BAD", "[scene]\nnmae = \"x\"\n", 2, "bad.toml:2:1: unknown key \"nmae\""},
        Mistake{"WrongType", "check BAD", "[scene]\nname = \"x\"\n[sun]\ndirection = \"up\"\n", 2, "bad.toml:4:"},
        Mistake{"MissingMesh", "check BAD",
                "[[body]]\nname = \"a\"\nmesh = \"gone.obj\"\n[[lidar]]\nname = \"l\"\nmodel = \"VLP-16\"\nrate_hz "
                "= 10\n",
                2, "gone.obj"},
        Mistake{"CameraWithoutIntrinsics", "check BAD",
                "[[camera]]\nname = \"c\"\nresolution = [8, 8]\nrate_hz = 1\n", 2, "bad.toml:1:"},
        Mistake{
            "MountThatIsNotThere", "check BAD",
            "[[camera]]\nname = \"c\"\nmount = \"x\"\nresolution = [8, 8]\nfov_horizontal_deg = 9\nrate_hz = 1\n",
            2, "bad.toml:3:"},
        // Trajectories
        Mistake{"NoTrajectory", "fly FOLDERnone.csv --can slcan:1", nullptr, 2, "none.csv: cannot be opened"},
        Mistake{"TrajectoryWithoutHeader", "fly SCENE --can slcan:1", nullptr, 2,
                "scene.toml:1:1: expected the header line"},
        Mistake{"TrajectoryWithAWord", "fly BAD --can slcan:1", kHeader, 2,
                "bad.toml:2:9: \"x\" where a finite number was expected"},
        // Buses
        Mistake{"UnknownBus", "run SCENE --can token-ring:1 --video nav=none", nullptr, 2, "token-ring"},
        Mistake{"BadSlcanPort", "run SCENE --can slcan:99999 --video nav=none", nullptr, 2, "99999"},
        Mistake{"NoSuchInterface", "run SCENE --can can77 --video nav=none", nullptr, 3, "can77"},
        Mistake{"LogThatIsNotThere", "run SCENE --can log:FOLDERnone.log --video nav=none", nullptr, 2, "none.log"},
        Mistake{"LogThatIsNoLog", "run SCENE --can log:SCENE --video nav=none", nullptr, 2, "scene.toml:1"},
        // Devices and sinks
        Mistake{"NoSuchVideoDevice", "run SCENE --video nav=/dev/video77", nullptr, 3, "modprobe v4l2loopback"},
        Mistake{"NotAVideoDevice", "run SCENE --video nav=/dev/null", nullptr, 3, "/dev/null"},
        Mistake{"UnknownSink", "run SCENE --video nav=film.mov", nullptr, 2, "film.mov"},
        Mistake{"UnknownCamera", "run SCENE --video eye=none", nullptr, 2,
                "no camera named \"eye\", expected one of: nav"},
        Mistake{"SinkWithoutCamera", "run SCENE --video none", nullptr, 2, "CAMERA=SINK"},
        Mistake{"BadUdpPort", "run SCENE --lidar top=udp:127.0.0.1:x", nullptr, 2, "udp:127.0.0.1:x"},
        Mistake{"OneVideoFileTwice", "run SCENE --duration 0.1 --video nav=FOLDERz.y4m --video nav=FOLDER./z.y4m",
                nullptr, 2, "z.y4m: another output goes there too"},
        Mistake{"OneCaptureTwice",
                "run SCENE --duration 0.1 --lidar top=FOLDERz.pcap --lidar top=none --lidar top=FOLDERz.pcap",
                nullptr, 2, "z.pcap: another output goes there too"},
        Mistake{"OneUdpPortTwice",
                "run SCENE --duration 0.1 --lidar top=udp:127.0.0.1:2368 --lidar top=udp:127.0.0.1:2368,ttl=2",
                nullptr, 2, "udp:127.0.0.1:2368,ttl=2: another output goes there too, expected a port"},
        Mistake{"NothingToPutOut", "run SCENE", nullptr, 2, "--video"},
        Mistake{"ProcessorsInLockstep", "run SCENE --lockstep --cpus 0 --can log:none --video nav=none", nullptr, 2,
                "--lockstep excludes --cpus"},
        Mistake{"LockstepWithoutABus", "run SCENE --lockstep --video nav=none", nullptr, 2, "--can"},
        // Pictures and scans
        Mistake{"UnknownImageKind", "render SCENE -o FOLDERa.gif", nullptr, 2, "a.gif"},
        Mistake{"UnknownPlotKind", "bench loop -o FOLDERa.gif", nullptr, 2,
                "a.gif: expected the name of a picture"},
        Mistake{"PoseBesideATrajectory", "render SCENE --trajectory BAD --pose chaser=0,0,0,1,0,0,0 -o FOLDERa.png",
                kFlight, 2, "bad.toml:2: has poses of body \"chaser\", and --pose has another"},
        Mistake{"TimeAfterTheTrajectory", "render SCENE --trajectory BAD --time 100 -o FOLDERa.png", kFlight, 0,
                "bad.toml: has poses of body \"chaser\" from 0 to 0 s, not at 100 s; there it rests near the last"},
        Mistake{"TimeBeforeTheTrajectory", "map SCENE --trajectory BAD --time -3 -o FOLDERa.json", kFlight, 0,
                "from 0 to 0 s, not at -3 s; there it rests near the first"},
        // Nobody, not even root, can make a file in /proc.
        Mistake{"ScanThatCannotBeWritten", "scan SCENE -o /proc/a.csv", nullptr, 3,
                "/proc/a.csv: cannot be written: "},
        Mistake{"MapThatCannotBeWritten", "map SCENE -o /proc/a.png", nullptr, 3,
                "/proc/a.json: cannot be written: "},
        Mistake{"DbcThatCannotBeWritten", "check SCENE --dbc /proc/a.dbc", nullptr, 3,
                "/proc/a.dbc: cannot be written: "},
        Mistake{"FolderThatCannotBeMade", "render SCENE -o /proc/nowhere/a.png", nullptr, 2, "/proc/nowhere/a.png"},
        Mistake{"DepthWithoutPaths", "render SCENE --max-depth 3 -o FOLDERa.png", nullptr, 2, "--max-depth"},
        Mistake{"OutputsThatAPngCannotHold", "render SCENE --aov depth -o FOLDERa.png", nullptr, 2, "FILE.exr"},
        Mistake{"TimeBeyondTheClock", "render SCENE --time 1e12 -o FOLDERa.png", nullptr, 2, "--time"},
        Mistake{"UnknownFormat", "render SCENE --format NV12 -o FOLDERa.png", nullptr, 2, "NV12"},
        Mistake{"PoseOfNobody", "render SCENE --pose x=0,0,0,1,0,0,0 -o FOLDERa.png", nullptr, 2,
                "no body named \"x\""},
        Mistake{"TwoPosesOfOneBody",
                "render SCENE --pose chaser=0,0,0,1,0,0,0 --pose chaser=1,0,0,1,0,0,0 -o FOLDERa.png", nullptr, 2,
                "body \"chaser\" has a pose already"},
        Mistake{"UpWithoutHeight", "map SCENE --up 0,1,0 -o FOLDERa.json", nullptr, 2, "expected --of height"},
        Mistake{"ContourLinesInPfm", "map SCENE --interval 1 -o FOLDERa.pfm", nullptr, 2,
                "a.pfm: a PFM file holds no contour lines"},
        Mistake{"PoseThatIsNoRotation", "render SCENE --pose chaser=0,0,0,1,1,0,0 -o FOLDERa.png", nullptr, 2,
                "norm"},
        Mistake{"UnknownCloudKind", "scan SCENE -o FOLDERa.xyz", nullptr, 2, "expected .ply, .pcd, .csv or .pcap"},
        // Command lines
        Mistake{"RunOfNoDuration", "run SCENE --video nav=none --duration 0", nullptr, 2,
                "--duration: 0, expected a number greater than 0"},
        Mistake{"ScanOfNoDuration", "scan SCENE --duration 0 -o FOLDERa.csv", nullptr, 2,
                "--duration: 0, expected a number greater than 0"},
        Mistake{"EmptyTrajectory", "render SCENE --trajectory '' -o FOLDERa.png", nullptr, 2,
                "narpa render: --trajectory has an empty value"},
        Mistake{"EmptyCamera", "render SCENE --camera= -o FOLDERa.png", nullptr, 2, "--camera has an empty value"},
        Mistake{"EmptyBus", "run SCENE --can '' --video nav=none --duration 0.1", nullptr, 2,
                "--can has an empty value"},
        Mistake{"EmptyLog", "run SCENE --video nav=none --duration 0.1 --log ''", nullptr, 2,
                "--log has an empty value"},
        Mistake{"EmptyEstimate", "run SCENE --video nav=none --duration 0.1 --estimate ''", nullptr, 2,
                "--estimate has an empty value"},
        Mistake{"EmptyDbc", "check SCENE --dbc ''", nullptr, 2, "--dbc has an empty value"},
        Mistake{"EmptyNumber", "render SCENE --time '' -o FOLDERa.png", nullptr, 2, "--time has an empty value"},
        Mistake{"EmptyScenario", "rehearse ''", nullptr, 2, "narpa rehearse: an argument is empty"},
        Mistake{"NoSubcommand", "", nullptr, 2, "Usage: narpa COMMAND"},
        Mistake{"UnknownOption", "check SCENE --colour", nullptr, 2, "--colour"}),
    [](const auto& mistake) { return std::string(mistake.param.name); });

TEST(RunCommand, MakesFoldersOfItsFiles) {
    const TemporaryFolder folder;
    std::ofstream(folder / "scene.toml") << small_scene();
    const Done done = run_command(std::string(kTimeLimit) + NARPA_BIN + " run " + (folder / "scene.toml") +
                                  " --duration 0.2 --video nav=" + (folder / "new/a/x.y4m") +
                                  " --lidar top=" + (folder / "new/b/x.pcap") + " 2>&1 >/dev/null");
    EXPECT_EQ(done.status, 0) << done.out;
    EXPECT_TRUE(std::filesystem::exists(folder / "new/a/x.y4m"));
    EXPECT_TRUE(std::filesystem::exists(folder / "new/b/x.pcap"));
}

/// Each command is given one of its inputs as an output, by another path.
class InputsAreKept : public ::testing::TestWithParam<std::pair<const char*, const char*>> {
protected:
    void SetUp() override {
        std::ofstream(folder_ / "base.csv") << small_scene();
        std::ofstream(folder_ / "mesh.ply") << "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                                               "property float y\nproperty float z\nproperty float s\n"
                                               "property float t\nelement face 1\n"
                                               "property list uchar int vertex_indices\nend_header\n"
                                               "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n";
        std::ofstream(folder_ / "flight.csv") << kFlight;
        std::ofstream(folder_ / "scene.toml") << "[scene]\nbased_on = \"base.csv\"\n";
        ASSERT_EQ(narpa("render scene.toml -o image.png").status, 0);
        std::filesystem::copy(folder_ / "image.png", folder_ / "picture.json");
        std::ofstream(folder_ / "textured.toml")
            << small_scene() +
                   "[[body]]\nname = \"a\"\nmesh = \"mesh.ply\"\nmaterial = {kind = \"lambert\", texture "
                   "= \"image.png\"}\n[[body]]\nname = \"b\"\nmesh = \"mesh.ply\"\nmaterial = {kind "
                   "= \"lambert\", texture = \"picture.json\"}\n";
        std::filesystem::create_directory(folder_ / "sub");
    }
    [[nodiscard]] Done narpa(const std::string& arguments) const {
        return run_command("cd " + (folder_ / "") + " && " + kTimeLimit + NARPA_BIN + " " + arguments + " 2>&1");
    }
    TemporaryFolder folder_;
};

TEST_P(InputsAreKept, WhereAnOutputHasTheirName) {
    const auto& [arguments, input] = GetParam();
    const std::string before = read_text(folder_ / input);
    const auto [status, said] = narpa(arguments);
    EXPECT_EQ(status, 2) << said;
    EXPECT_NE(said.find(std::string(input) + ": would be replaced, but this command reads it"), std::string::npos)
        << said;
    EXPECT_EQ(read_text(folder_ / input), before);
}

INSTANTIATE_TEST_SUITE_P(
    All, InputsAreKept,
    ::testing::Values(std::pair("scan scene.toml -o sub/../base.csv", "base.csv"),
                      std::pair("scan textured.toml -o ./mesh.ply", "mesh.ply"),
                      std::pair("render textured.toml -o sub/../image.png", "image.png"),
                      std::pair("map textured.toml -o picture.png", "picture.json"),
                      std::pair("scan scene.toml --trajectory flight.csv -o ./flight.csv", "flight.csv"),
                      std::pair("compare textured.toml --frame image.png -o picture.svg", "picture.json"),
                      std::pair("fly flight.csv --can log:sub/../flight.csv", "flight.csv")));

}  // namespace
}  // namespace narpa::test
