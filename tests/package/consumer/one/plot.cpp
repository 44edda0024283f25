#include <nlohmann/json.hpp>

int main() {
    return nlohmann::json{{"plot", 1}}.dump() == R"({"plot":1})" ? 0 : 1;
}
