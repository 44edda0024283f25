#include <narpa/rehearsal/scenario/scenario.h>
#include <cstdio>
#include <string>

int main(int, char** argv) {
    const auto scenario = narpa::rehearsal::read_scenario(argv[1] + std::string("/rehearsal/docking.toml"));
    return scenario ? 0 : (std::puts(scenario.error().text().c_str()), 1);
}
