#include "estimator/batch/batch_costs.h"

#include <Eigen/Dense>
#include <algorithm>

namespace narpa {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using StateJacobian = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, kStateSize, Eigen::RowMajor>>;

class StateManifold final : public ceres::Manifold {
public:
    explicit StateManifold(bool has_motion) : errors_(estimated_errors(has_motion)) {}

    int AmbientSize() const override { return kStateSize; }
    int TangentSize() const override { return static_cast<int>(errors_.size()); }
    bool Plus(const double* x, const double* delta, double* sum) const override {
        Vector12 error = Vector12::Zero();
        for (std::size_t i = 0; i < errors_.size(); ++i) error[errors_[i]] = delta[i];
        pack(displaced(unpack(x), error), sum);
        return true;
    }
    bool PlusJacobian(const double*, double* jacobian) const override {
        Eigen::Map<RowMajor> J(jacobian, kStateSize, TangentSize());
        J.setZero();
        for (int i = 0; i < TangentSize(); ++i) J(errors_[static_cast<std::size_t>(i)], i) = 1;
        return true;
    }
    bool Minus(const double* y, const double* x, double* delta) const override {
        const Vector12 error = error_between(unpack(x), unpack(y));
        for (std::size_t i = 0; i < errors_.size(); ++i) delta[i] = error[errors_[i]];
        return true;
    }
    bool MinusJacobian(const double*, double* jacobian) const override {
        Eigen::Map<RowMajor> J(jacobian, TangentSize(), kStateSize);
        J.setZero();
        for (int i = 0; i < TangentSize(); ++i) J(i, errors_[static_cast<std::size_t>(i)]) = 1;
        return true;
    }

private:
    std::span<const int> errors_;
};

/// Writes derivatives by a state's error to the block's Jacobian, if Ceres wants it.
template <class Derivative>
void put_state_jacobian(double** jacobians, int block, const Derivative& by_error) {
    if (!jacobians || !jacobians[block]) return;
    StateJacobian J(jacobians[block], by_error.rows(), kStateSize);
    J.template leftCols<12>() = by_error;
    J.template rightCols<1>().setZero();
}

class MeasurementCost final : public ceres::CostFunction {
public:
    MeasurementCost(const Measurement& measurement, const Score& score, const SensorPlace& place,
                    const SharedBlock& shared)
        : measurement_(measurement), score_(score), place_(place), shared_(shared) {
        set_num_residuals(static_cast<int>(score.whitening.rows()));
        mutable_parameter_block_sizes()->push_back(kStateSize);
        if (shared.size() > 0) mutable_parameter_block_sizes()->push_back(static_cast<int>(shared.size()));
    }

    bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
        const BatchValues values = shared_.values(shared_.size() > 0 ? blocks[1] : nullptr);
        const SensorView view = sensor_view(unpack(blocks[0]), place_, values);
        Residuals measured;
        if (!measurement_.evaluate(view.T_sensor_target, values, measured)) return false;
        Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()) = score_.whitening * measured.value;
        if (!jacobians) return true;
        const Eigen::MatrixXd J = score_.whitening * measured.jacobian;
        put_state_jacobian(jacobians, 0, J.leftCols<6>() * view.by_state);
        if (shared_.size() > 0 && jacobians[1])
            Eigen::Map<RowMajor>(jacobians[1], J.rows(), static_cast<Eigen::Index>(shared_.size())) =
                by_shared(J, view);
        return true;
    }

private:
    [[nodiscard]] Eigen::MatrixXd by_shared(const Eigen::MatrixXd& J, const SensorView& view) const {
        Eigen::MatrixXd out = Eigen::MatrixXd::Zero(J.rows(), static_cast<Eigen::Index>(shared_.size()));
        const auto add = [&](BatchUnknown u, int offset, const Eigen::VectorXd& column) {
            const int place = shared_.place(static_cast<BatchUnknown>(static_cast<int>(u) + offset));
            if (place >= 0) out.col(place) += shared_.sigma(static_cast<std::size_t>(place)) * column;
        };
        const auto unknowns = measurement_.unknowns();
        for (std::size_t i = 0; i < unknowns.size(); ++i)
            add(unknowns[i], 0, J.col(6 + static_cast<Eigen::Index>(i)));
        for (int axis = 0; axis < 3; ++axis) {
            add(place_.mount_rotation, axis, J.leftCols<6>() * view.by_mount.col(axis));
            add(place_.mount_shift, axis, J.leftCols<6>() * view.by_mount.col(3 + axis));
        }
        add(BatchUnknown::scale, 0, J.leftCols<6>() * view.by_scale);
        if (place_.has_clock) add(BatchUnknown::clock, 0, J.leftCols<6>() * view.by_clock);
        return out;
    }

    const Measurement& measurement_;
    const Score& score_;
    SensorPlace place_;
    const SharedBlock& shared_;
};

/// Derivative of a rotation vector by one at its right end, to first order; its transpose is minus that by one at
/// its left end.
Eigen::Matrix3d end_derivative(const Vector12& error) {
    return Eigen::Matrix3d::Identity() + 0.5 * skew(error.segment<3>(6));
}

class MotionCost final : public ceres::SizedCostFunction<12, kStateSize, kStateSize> {
public:
    MotionCost(const MotionModel& model, double dt_s, const RelativeState& from) : model_(model), dt_s_(dt_s) {
        RelativeState state = from;
        Matrix12 noise = Matrix12::Zero();
        propagate(model_, dt_s_, {}, state, noise);
        root_ = noise.llt().matrixL();
        for (int i = 0; i < 12; ++i) {
            constexpr double kStep = 1e-5;
            Vector12 step = Vector12::Zero();
            step[i] = kStep;
            transition_.col(i) =
                error_between(predicted(displaced(from, -step)), predicted(displaced(from, step))) / (2 * kStep);
        }
    }

    bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
        const Vector12 error = error_between(predicted(unpack(blocks[0])), unpack(blocks[1]));
        const auto L = root_.triangularView<Eigen::Lower>();
        Eigen::Map<Eigen::Matrix<double, 12, 1>>{residuals} = L.solve(error);
        if (!jacobians) return true;
        Matrix12 by_end = Matrix12::Identity(), by_begin = Matrix12::Identity();
        by_end.block<3, 3>(6, 6) = end_derivative(error);
        by_begin.block<3, 3>(6, 6) = end_derivative(error).transpose();
        put_state_jacobian(jacobians, 0, Eigen::MatrixXd(L.solve(-by_begin * transition_)));
        put_state_jacobian(jacobians, 1, Eigen::MatrixXd(L.solve(by_end)));
        return true;
    }

private:
    [[nodiscard]] RelativeState predicted(RelativeState state) const {
        Matrix12 unused = Matrix12::Zero();
        propagate(model_, dt_s_, {}, state, unused);
        return state;
    }

    MotionModel model_;
    double dt_s_;
    Matrix12 root_, transition_;
};

class PathCost final : public ceres::CostFunction {
public:
    PathCost(const BatchTime& time, const PathSigma& sigma, const SharedBlock& shared)
        : known_(*time.T_chaser_target), shared_(shared) {
        place_.q_frame_chaser = time.q_frame_chaser;
        weights_ << Eigen::Vector3d::Constant(1 / sigma.rotation_rad),
            Eigen::Vector3d::Constant(1 / sigma.position_m);
        set_num_residuals(6);
        mutable_parameter_block_sizes()->push_back(kStateSize);
        if (shared.size() > 0) mutable_parameter_block_sizes()->push_back(static_cast<int>(shared.size()));
    }
    bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
        BatchValues scale{};
        at(scale, BatchUnknown::scale) =
            at(shared_.values(shared_.size() > 0 ? blocks[1] : nullptr), BatchUnknown::scale);
        const SensorView view = sensor_view(unpack(blocks[0]), place_, scale);
        Eigen::Map<Eigen::Matrix<double, 6, 1>>{residuals} =
            weights_.cwiseProduct(error_between(known_, view.T_sensor_target));
        put_state_jacobian(jacobians, 0, Eigen::MatrixXd(weights_.asDiagonal() * view.by_state));
        if (!jacobians || shared_.size() == 0 || !jacobians[1]) return true;
        Eigen::Map<RowMajor> by_shared(jacobians[1], 6, static_cast<Eigen::Index>(shared_.size()));
        by_shared.setZero();
        if (const int place = shared_.place(BatchUnknown::scale); place >= 0)
            by_shared.col(place) =
                shared_.sigma(static_cast<std::size_t>(place)) * weights_.cwiseProduct(view.by_scale);
        return true;
    }

private:
    Rigid3 known_;
    const SharedBlock& shared_;
    Vector6 weights_;
    SensorPlace place_;
};

class PriorCost final : public ceres::CostFunction {
public:
    explicit PriorCost(std::size_t unknowns) {
        set_num_residuals(static_cast<int>(unknowns));
        mutable_parameter_block_sizes()->push_back(static_cast<int>(unknowns));
    }
    bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
        std::copy_n(blocks[0], num_residuals(), residuals);
        if (jacobians && jacobians[0])
            Eigen::Map<RowMajor>(jacobians[0], num_residuals(), num_residuals()).setIdentity();
        return true;
    }
};

}  // namespace

void pack(const RelativeState& s, double* b) {
    const std::array<double, kStateSize> all{
        s.position_m.x,   s.position_m.y,     s.position_m.z,     s.velocity_m_s.x,   s.velocity_m_s.y,
        s.velocity_m_s.z, s.q_frame_target.w, s.q_frame_target.x, s.q_frame_target.y, s.q_frame_target.z,
        s.rate_rad_s.x,   s.rate_rad_s.y,     s.rate_rad_s.z};
    std::ranges::copy(all, b);
}

RelativeState unpack(const double* b) {
    return {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}, {b[6], b[7], b[8], b[9]}, {b[10], b[11], b[12]}};
}

std::span<const int> estimated_errors(bool has_motion) {
    static constexpr std::array kAll{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
    static constexpr std::array kOfPose{0, 1, 2, 6, 7, 8};
    return has_motion ? std::span<const int>(kAll) : std::span<const int>(kOfPose);
}

std::unique_ptr<ceres::Manifold> make_state_manifold(bool has_motion) {
    return std::make_unique<StateManifold>(has_motion);
}

SharedBlock::SharedBlock(const BatchValues& prior_sigma) {
    places_.fill(-1);
    for (std::size_t i = 0; i < kBatchUnknowns; ++i) {
        if (!(prior_sigma[i] > 0)) continue;
        places_[i] = static_cast<int>(unknowns_.size());
        unknowns_.push_back(static_cast<BatchUnknown>(i));
        sigmas_.push_back(prior_sigma[i]);
    }
}

BatchValues SharedBlock::values(const double* block) const {
    BatchValues values{};
    for (std::size_t i = 0; i < unknowns_.size(); ++i) at(values, unknowns_[i]) = sigmas_[i] * block[i];
    return values;
}

std::vector<Eigen::Index> estimated_columns(const Measurement& measurement, const SharedBlock& shared) {
    std::vector<Eigen::Index> columns{0, 1, 2, 3, 4, 5};
    const auto unknowns = measurement.unknowns();
    for (std::size_t i = 0; i < unknowns.size(); ++i)
        if (shared.place(unknowns[i]) >= 0) columns.push_back(6 + static_cast<Eigen::Index>(i));
    return columns;
}

std::unique_ptr<ceres::CostFunction> measurement_cost(const Measurement& measurement, const Score& score,
                                                      const SensorPlace& place, const SharedBlock& shared) {
    return std::make_unique<MeasurementCost>(measurement, score, place, shared);
}

std::unique_ptr<ceres::CostFunction> motion_cost(const MotionModel& model, double dt_s, const RelativeState& from) {
    return std::make_unique<MotionCost>(model, dt_s, from);
}

std::unique_ptr<ceres::CostFunction> path_cost(const BatchTime& time, const PathSigma& sigma,
                                               const SharedBlock& shared) {
    return std::make_unique<PathCost>(time, sigma, shared);
}

std::unique_ptr<ceres::CostFunction> prior_cost(std::size_t unknowns) {
    return std::make_unique<PriorCost>(unknowns);
}

}  // namespace narpa
