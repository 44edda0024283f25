#include "dataset/gather/annotations.h"

#include <map>
#include <nlohmann/json.hpp>
#include <string>

namespace narpa::dataset {
namespace {

using nlohmann::json;

constexpr std::size_t kSpeedCoefficients = 5;  ///< at least, of distCoeffs: k1, k2, p1, p2, k3
constexpr int kOutsideFlag = 0, kOccludedFlag = 1, kVisibleFlag = 2;

int visibility_flag(const json& keypoint) {
    const auto state = keypoint.at("state").get<std::string>();
    return state == "visible" ? kVisibleFlag : state == "occluded" ? kOccludedFlag : kOutsideFlag;
}

void add_keypoints(const json& label, json& annotation) {
    json numbers = json::array();
    int count = 0;
    for (const json& k : label.at("keypoints")) {
        const int flag = visibility_flag(k);
        const bool is_labelled = flag != kOutsideFlag;
        numbers.push_back(is_labelled ? k.at("px").at(0) : json(0));
        numbers.push_back(is_labelled ? k.at("px").at(1) : json(0));
        numbers.push_back(flag);
        count += is_labelled ? 1 : 0;
    }
    annotation["keypoints"] = numbers;
    annotation["num_keypoints"] = count;
}

json category_of(const json& body, const json& label) {
    json category{{"id", body.at("id")}, {"name", body.at("name")}, {"supercategory", "body"}};
    if (body.at("id") != label.at("target_id")) return category;
    json names = json::array();
    for (std::size_t i = 0; i < label.at("keypoints").size(); ++i)
        names.push_back("point_" + std::to_string(i + 1));
    category["keypoints"] = names;
    category["skeleton"] = json::array();
    return category;
}

}  // namespace

struct CocoDocument::Parts {
    json images = json::array(), annotations = json::array();
    std::map<int, json> categories{};  ///< by the body's number
};

CocoDocument::CocoDocument() : parts_(std::make_unique<Parts>()) {}
CocoDocument::~CocoDocument() = default;

void CocoDocument::add(const json& label) {
    const json& camera = label.at("camera");
    parts_->images.push_back({{"id", label.at("image")},
                              {"file_name", label.at("file")},
                              {"width", camera.at("width")},
                              {"height", camera.at("height")}});
    for (const json& body : label.at("bodies")) {
        parts_->categories.try_emplace(body.at("id").get<int>(), category_of(body, label));
        if (body.at("area_px") == 0) continue;
        json annotation{{"id", parts_->annotations.size() + 1},
                        {"image_id", label.at("image")},
                        {"category_id", body.at("id")},
                        {"bbox", body.at("bbox_px")},
                        {"area", body.at("area_px")},
                        {"segmentation", body.at("segmentation")},
                        {"iscrowd", 0}};
        if (body.at("id") == label.at("target_id")) add_keypoints(label, annotation);
        parts_->annotations.push_back(std::move(annotation));
    }
}

json CocoDocument::document() const {
    json categories = json::array();
    for (const auto& [id, category] : parts_->categories) categories.push_back(category);
    return {{"info", {{"description", "made by narpa dataset"}}},
            {"images", parts_->images},
            {"annotations", parts_->annotations},
            {"categories", categories}};
}

json speed_entry(const json& label) {
    const json& T = label.at("T_camera_target");
    json q = T.at("attitude_wxyz");
    if (q.at(0).get<double>() < 0)
        for (json& component : q) component = -component.get<double>();
    return {{"filename", label.at("file").get<std::string>().substr(sizeof "images/" - 1)},
            {"q_vbs2tango_true", q},
            {"r_Vo2To_vbs_true", T.at("position_m")}};
}

json speed_camera(const json& label) {
    const json& camera = label.at("camera");
    const json& K = camera.at("camera_matrix");
    if (K.is_null()) return nullptr;
    const json& pitch = camera.at("pixel_pitch_m");
    const auto length = [&](const json& px) {
        return pitch.is_null() ? json(nullptr) : json(px.get<double>() * pitch.get<double>());
    };
    json coefficients = camera.at("distortion_coefficients");
    if (camera.at("distortion_model") == "opencv")
        while (coefficients.size() < kSpeedCoefficients) coefficients.push_back(0);
    return {{"Nu", camera.at("width")},
            {"Nv", camera.at("height")},
            {"ppx", pitch},
            {"ppy", pitch},
            {"fx", length(K.at(0).at(0))},
            {"fy", length(K.at(1).at(1))},
            {"ccx", K.at(0).at(2)},
            {"ccy", K.at(1).at(2)},
            {"cameraMatrix", K},
            {"distCoeffs", coefficients},
            {"distortionModel", camera.at("distortion_model")}};
}

}  // namespace narpa::dataset
