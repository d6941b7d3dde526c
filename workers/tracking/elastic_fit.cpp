// SPDX-License-Identifier: AGPL-3.0-or-later
// Legend:
//   y = position + M a   where a node carries a point, a = G (x − centre): its arm as the deformation `before`, with gradient G, left it
//   M                    the node's change since `before`, the identity at first; position and M's columns are its 12 unknowns
//   ã = (1, a)           so that y = Σ ã_i u_i over the four 3-vectors of unknowns
//   e                    the edge from node k to node l as `before` left it
#include "workers/tracking/elastic_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vorocast::tracking {
namespace {

using geometry::Mat3;
using geometry::Quat;
using geometry::Vec3;
using geometry::Vec3f;

// As in FrameFit: samples are a centimetre apart, and their spacing says nothing about the fit.
constexpr float kAlongSurface = 0.15F;
// Weight of the regulariser at 1, for each point there is to a node. 0.3 is near the best on captures with known motion.
constexpr double kRegulariserBalance = 1.0 / 300;
// Edges should lie as `before` left them, but for this share as the template had them: errors must not add up from frame to frame.
constexpr double kFromBefore = 0.4;
// Of neighbours' changes being alike, against each other's centres lying where they say.
constexpr double kAlikeWeight = 1;
// Pull of every gradient towards a rotation, for each of its edges: hardly felt, but nothing collapses.
constexpr double kRigidWeight = 0.03;
constexpr double kInnerWeight = 0.03;
constexpr double kInnerReach = 1.2;  // cell spacings
constexpr double kDamping = 1e-4;
constexpr int kSolverSteps = 12;
constexpr double kSolverTolerance = 1e-8;  // of the squared residual

}  // namespace

Mat3 NearestRotation(const Mat3& matrix) {
  Mat3 rotation = matrix;
  bool converged = matrix.determinant() > 0.05;
  for (int i = 0; converged && i < 8; ++i) {
    // Newton's iteration for the orthogonal polar factor (Higham).
    const Mat3 inverse = rotation.inverse();
    const Mat3 next = 0.5 * (rotation + inverse.transpose());
    const double moved = (next - rotation).squaredNorm();
    rotation = next;
    if (moved < 1e-24) return rotation;
  }
  if (converged && (rotation * rotation.transpose() - Mat3::Identity()).squaredNorm() < 1e-20) return rotation;
  const Eigen::JacobiSVD<Mat3> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vec3 sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

Deformation DeformationOf(const PatchModel& model, const Pose& pose) {
  Deformation deformation(pose.size());
  for (std::size_t k = 0; k < pose.size(); ++k) deformation[k] = {pose[k] * model.centre[k], pose[k].rotation.toRotationMatrix()};
  return deformation;
}

Pose PoseOf(const PatchModel& model, const Deformation& deformation) {
  Pose pose(deformation.size());
  for (std::size_t k = 0; k < pose.size(); ++k) {
    // argmin_R Σ mass |R x − gradient x|² over the cells.
    const Quat rotation = Quat(NearestRotation(deformation[k].gradient * model.covariance[k] / (model.covariance[k].trace() / 3))).normalized();
    pose[k] = {rotation, deformation[k].position - rotation * model.centre[k]};
  }
  return pose;
}

ElasticFit::ElasticFit(const PatchModel& model)
    : model_(model),
      data_(static_cast<std::size_t>(model.patch_count)),
      arms_(model.edges.size()),
      diagonal_(data_.size()),
      gradient_(data_.size()) {}

void ElasticFit::PoseSurface(const Deformation& now, const ElasticStage& stage) {
  origin_ = now[0].position;
  std::vector<Eigen::Matrix3f> gradient;
  std::vector<Eigen::Matrix3f> cofactor;  // carries normals
  std::vector<Vec3f> position;
  for (const AffineNode& node : now) {
    const Mat3& g = node.gradient;
    Mat3 c;
    c << g.col(1).cross(g.col(2)), g.col(2).cross(g.col(0)), g.col(0).cross(g.col(1));
    gradient.push_back(g.cast<float>());
    cofactor.push_back(c.cast<float>());
    position.push_back((node.position - origin_).cast<float>());
  }
  posed_.clear();
  for (std::size_t i = 0; i < model_.surface.size(); ++i) {
    const SurfaceSample& sample = model_.surface[i];
    const std::int32_t k = sample.patch;
    const Vec3f normal = cofactor[k] * sample.normal.cast<float>();
    const float length = normal.norm();
    posed_.push_back({position[k] + gradient[k] * (sample.position - model_.centre[k]).cast<float>(),
                      length > 0 ? Vec3f(normal / length) : Vec3f(sample.normal.cast<float>()), 0, static_cast<std::int32_t>(i)});
  }
  surface_.Build(posed_, static_cast<float>(stage.reach_m));
}

ElasticFit::Partner ElasticFit::SurfacePartner(const Vec3f& x, const Vec3f& normal, const ElasticStage& stage) const {
  Partner best;
  const auto reach_squared = static_cast<float>(stage.reach_m * stage.reach_m);
  const auto cosine_min = static_cast<float>(stage.cosine_min);
  surface_.VisitNear(x, [&](const PosedPoint& point) {
    const Vec3f delta = point.position - x;
    const float squared = delta.squaredNorm();
    if (squared > reach_squared || normal.dot(point.normal) < cosine_min) return;
    const float across = delta.dot(point.normal);
    const float score = kAlongSurface * squared + (1 - kAlongSurface) * across * across;
    if (best.point == nullptr || score < best.score) best = {&point, score};
  });
  return best;
}

void ElasticFit::AddSurface(const ObservedFrame& frame, const ElasticStage& stage, const Deformation& before) {
  for (std::size_t i = stage.phase % stage.stride; i < frame.position.size(); i += stage.stride) {
    const Vec3f x = (frame.position[i] - origin_).cast<float>();
    const Vec3f normal = frame.normal[i].cast<float>();
    const Partner partner = SurfacePartner(x, normal, stage);
    if (partner.point == nullptr) continue;
    const SurfaceSample& sample = model_.surface[partner.point->patch];
    // The normal halfway between both is exact on spheres and cylinders, where either tangent plane alone is off by offset² / 2 radius.
    const Vec3 n = (normal + partner.point->normal).cast<double>().normalized();
    const double distance = n.dot((partner.point->position - x).cast<double>());
    const double weight = static_cast<double>(stage.stride) * std::exp(-0.5 * distance * distance / (stage.sigma_m * stage.sigma_m));
    const Vec3 a = before[sample.patch].gradient * (sample.position - model_.centre[sample.patch]);
    Eigen::Matrix<double, 10, 1> arms;
    arms << 1, a.x(), a.y(), a.z(), a.x() * a.x(), a.x() * a.y(), a.x() * a.z(), a.y() * a.y(), a.y() * a.z(), a.z() * a.z();
    Eigen::Matrix<double, 6, 1> plane;
    plane << n.x() * n.x(), n.x() * n.y(), n.x() * n.z(), n.y() * n.y(), n.y() * n.z(), n.z() * n.z();
    NodeData& data = data_[sample.patch];
    data.square.noalias() += (weight * plane) * arms.transpose();
    data.gradient.noalias() += (weight * distance * n) * arms.head<4>().transpose();
  }
}

void ElasticFit::AddInner(const ObservedFrame& frame, const ElasticStage& stage, const Deformation& before, const Deformation& now) {
  if (frame.inner.empty()) return;
  const double reach = kInnerReach * model_.cell_spacing_m;
  const double sigma = std::max(stage.sigma_m, 0.5 * model_.cell_spacing_m);
  posed_.clear();
  for (std::size_t i = 0; i < model_.inner.size(); ++i) {
    const InnerSample& sample = model_.inner[i];
    const AffineNode& node = now[sample.patch];
    posed_.push_back({(node.position + node.gradient * (sample.position - model_.centre[sample.patch]) - origin_).cast<float>(), Vec3f::Zero(),
                      static_cast<float>(sample.depth), static_cast<std::int32_t>(i)});
  }
  inner_.Build(posed_, static_cast<float>(reach));
  const double scale = kInnerWeight * static_cast<double>(stage.inner_stride);
  for (std::size_t i = stage.phase % stage.inner_stride; i < frame.inner.size(); i += stage.inner_stride) {
    const Vec3f x = (frame.inner[i] - origin_).cast<float>();
    const auto depth = static_cast<float>(frame.inner_depth[i]);
    const PosedPoint* nearest = nullptr;
    auto least = static_cast<float>(reach * reach);
    inner_.VisitNear(x, [&](const PosedPoint& point) {
      const float squared = (point.position - x).squaredNorm();
      if (squared < least && std::abs(point.depth - depth) <= stage.depth_tolerance_m) least = squared, nearest = &point;
    });
    if (nearest == nullptr) continue;
    const InnerSample& sample = model_.inner[nearest->patch];
    const double weight = scale * std::exp(-0.5 * least / (sigma * sigma));
    const Vec3 a = before[sample.patch].gradient * (sample.position - model_.centre[sample.patch]);
    const Vec3 delta = (nearest->position - x).cast<double>();
    Eigen::Matrix<double, 10, 1> arms;
    arms << 1, a.x(), a.y(), a.z(), a.x() * a.x(), a.x() * a.y(), a.x() * a.z(), a.y() * a.y(), a.y() * a.z(), a.z() * a.z();
    NodeData& data = data_[sample.patch];
    for (const int diagonal : {0, 3, 5}) data.square.row(diagonal) += weight * arms.transpose();
    data.gradient.noalias() += (weight * delta) * arms.head<4>().transpose();
  }
}

void ElasticFit::ExpandData() {
  constexpr std::array<std::array<int, 4>, 4> kArm = {{{0, 1, 2, 3}, {1, 4, 5, 6}, {2, 5, 7, 8}, {3, 6, 8, 9}}};
  for (std::size_t k = 0; k < data_.size(); ++k) {
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        const auto s = data_[k].square.col(kArm[i][j]);
        diagonal_[k].block<3, 3>(3 * i, 3 * j) << s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5];
      }
    }
    Eigen::Map<Columns>(gradient_[k].data()) = data_[k].gradient;
  }
}

void ElasticFit::AddRegulariser(const Deformation& before, const Deformation& now, double weight) {
  std::vector<Eigen::Matrix4d> square(data_.size(), Eigen::Matrix4d::Zero());  // ⊗ I₃
  std::vector<double> degree(data_.size(), 0);
  for (std::size_t i = 0; i < model_.edges.size(); ++i) {
    const PatchEdge& edge = model_.edges[i];
    const Vec3 rest = model_.centre[edge.l] - model_.centre[edge.k];
    const Vec3 left = before[edge.l].position - before[edge.k].position;
    EdgeArms& arms = arms_[i];
    arms.from_k = kFromBefore * left + (1 - kFromBefore) * before[edge.k].gradient * rest;
    arms.from_l = kFromBefore * left + (1 - kFromBefore) * before[edge.l].gradient * rest;
    arms.weight = weight * edge.share;
    arms.turn_weight = kAlikeWeight * arms.weight * rest.squaredNorm();
    // Two residuals: the edge as it is, less as each end says, y_l − y_k − M e.
    const Eigen::Vector4d k(-1, -arms.from_k.x(), -arms.from_k.y(), -arms.from_k.z());
    const Eigen::Vector4d l(1, -arms.from_l.x(), -arms.from_l.y(), -arms.from_l.z());
    square[edge.k] += arms.weight * k * k.transpose();
    square[edge.l] += arms.weight * l * l.transpose();
    square[edge.k](0, 0) += arms.weight;
    square[edge.l](0, 0) += arms.weight;
    for (const std::int32_t node : {edge.k, edge.l}) {
      square[node].diagonal().tail<3>().array() += arms.turn_weight;
      degree[node] += arms.weight * rest.squaredNorm();
    }
    const Vec3 lies = now[edge.l].position - now[edge.k].position;
    const Vec3 rk = arms.weight * (lies - change_[edge.k] * arms.from_k);
    const Vec3 rl = arms.weight * (lies - change_[edge.l] * arms.from_l);
    const Mat3 unlike = arms.turn_weight * (change_[edge.k] - change_[edge.l]);
    Eigen::Map<Columns> gk(gradient_[edge.k].data());
    Eigen::Map<Columns> gl(gradient_[edge.l].data());
    gk.col(0) -= rk + rl;
    gl.col(0) += rk + rl;
    gk.rightCols<3>() += unlike - rk * arms.from_k.transpose();
    gl.rightCols<3>() -= unlike + rl * arms.from_l.transpose();
  }
  for (std::size_t k = 0; k < data_.size(); ++k) {
    const double rigid = kRigidWeight * degree[k];
    square[k].diagonal().tail<3>().array() += rigid;
    Eigen::Map<Columns>(gradient_[k].data()).rightCols<3>() += rigid * (change_[k] - NearestRotation(now[k].gradient) * before_inverse_[k]);
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) diagonal_[k].block<3, 3>(3 * i, 3 * j).diagonal().array() += square[k](i, j);
    }
  }
}

/// out = H z: the diagonal blocks, and what each edge couples.
void ElasticFit::Apply(const std::vector<Vector12>& z, std::vector<Vector12>& out) const {
  for (std::size_t k = 0; k < z.size(); ++k) out[k].noalias() = diagonal_[k] * z[k];
  for (std::size_t i = 0; i < model_.edges.size(); ++i) {
    const PatchEdge& edge = model_.edges[i];
    const EdgeArms& arms = arms_[i];
    const Eigen::Map<const Columns> zk(z[edge.k].data());
    const Eigen::Map<const Columns> zl(z[edge.l].data());
    Eigen::Map<Columns> ok(out[edge.k].data());
    Eigen::Map<Columns> ol(out[edge.l].data());
    const Vec3 yk = arms.weight * zk.col(0);
    const Vec3 yl = arms.weight * zl.col(0);
    const Vec3 turned_k = arms.weight * (zk.rightCols<3>() * arms.from_k);
    const Vec3 turned_l = arms.weight * (zl.rightCols<3>() * arms.from_l);
    ok.col(0) += turned_l - 2 * yl;
    ol.col(0) -= turned_k + 2 * yk;
    ok.rightCols<3>() -= yl * arms.from_k.transpose() + arms.turn_weight * zl.rightCols<3>();
    ol.rightCols<3>() += yk * arms.from_l.transpose() - arms.turn_weight * zk.rightCols<3>();
  }
}

/// Conjugate gradients, preconditioned by the nodes' own blocks: step_ = −H⁻¹ g, about.
void ElasticFit::Solve() {
  const std::size_t n = data_.size();
  inverse_.resize(n);
  for (auto* vectors : {&step_, &residual_, &preconditioned_, &direction_, &product_}) vectors->assign(n, Vector12::Zero());
  double squared = 0;
  for (std::size_t k = 0; k < n; ++k) {
    diagonal_[k].diagonal() *= 1 + kDamping;
    diagonal_[k].diagonal().array() += 1e-12;
    inverse_[k] = diagonal_[k].llt().solve(Matrix12::Identity());
    residual_[k] = -gradient_[k];
    direction_[k].noalias() = inverse_[k] * residual_[k];
    squared += residual_[k].dot(direction_[k]);
  }
  const double enough = kSolverTolerance * squared;
  for (int i = 0; i < kSolverSteps && squared > enough; ++i) {
    Apply(direction_, product_);
    double curvature = 0;
    for (std::size_t k = 0; k < n; ++k) curvature += direction_[k].dot(product_[k]);
    if (!(curvature > 0)) return;
    const double length = squared / curvature;
    double next = 0;
    for (std::size_t k = 0; k < n; ++k) {
      step_[k] += length * direction_[k];
      residual_[k] -= length * product_[k];
      preconditioned_[k].noalias() = inverse_[k] * residual_[k];
      next += residual_[k].dot(preconditioned_[k]);
    }
    for (std::size_t k = 0; k < n; ++k) direction_[k] = preconditioned_[k] + next / squared * direction_[k];
    squared = next;
  }
}

void ElasticFit::Step(const ObservedFrame& frame, const ElasticStage& stage, const Deformation& before, Deformation& now) {
  for (NodeData& data : data_) data.square.setZero(), data.gradient.setZero();
  PoseSurface(now, stage);
  AddSurface(frame, stage, before);
  AddInner(frame, stage, before, now);
  ExpandData();
  change_.resize(now.size());
  before_inverse_.resize(now.size());
  for (std::size_t k = 0; k < now.size(); ++k) {
    before_inverse_[k] = before[k].gradient.inverse();
    change_[k] = now[k].gradient * before_inverse_[k];
  }
  const double points = std::max<double>(static_cast<double>(frame.position.size()), 1);
  AddRegulariser(before, now, stage.regulariser * kRegulariserBalance * points / static_cast<double>(now.size()));
  Solve();
  for (std::size_t k = 0; k < now.size(); ++k) {
    const Eigen::Map<const Columns> step(step_[k].data());
    const AffineNode moved{now[k].position + step.col(0), (change_[k] + step.rightCols<3>()) * before[k].gradient};
    // A node whose points lie on a line may ask for nonsense: it waits for its neighbours.
    if (step_[k].allFinite() && moved.gradient.determinant() > 0.1) now[k] = moved;
  }
}

void ElasticFit::Run(const ObservedFrame& frame, const std::vector<ElasticStage>& stages, Deformation& now) {
  Deformation before;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    if (i % 2 == 0) before = now;
    Step(frame, stages[i], before, now);
  }
}

FitQuality ElasticFit::Measure(const ObservedFrame& frame, const ElasticStage& stage, const Deformation& deformation) {
  PoseSurface(deformation, stage);
  const double limit = 4 * stage.sigma_m * stage.sigma_m;
  std::size_t seen = 0;
  std::size_t found = 0;
  double plane_squared = 0;
  double capped = 0;
  for (std::size_t i = stage.phase % stage.stride; i < frame.position.size(); i += stage.stride) {
    ++seen;
    const Vec3f x = (frame.position[i] - origin_).cast<float>();
    const Vec3f normal = frame.normal[i].cast<float>();
    const Partner partner = SurfacePartner(x, normal, stage);
    const bool near = partner.point != nullptr && partner.score < limit;
    capped += near ? partner.score : limit;
    if (!near) continue;
    ++found;
    const double across = (normal + partner.point->normal).normalized().dot(partner.point->position - x);
    plane_squared += across * across;
  }
  return QualityOf(seen, found, capped, plane_squared);
}

}  // namespace vorocast::tracking
