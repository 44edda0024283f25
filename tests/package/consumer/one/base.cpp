#include <narpa/base/pose.h>

int main() {
    const narpa::Rigid3 T{narpa::exp_rotation({0, 0, 0.1}), {1, 2, 3}};
    return narpa::norm(T * narpa::Vec3{} - T.t) < 1e-12 ? 0 : 1;
}
