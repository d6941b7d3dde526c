// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/regulariser.h"

namespace vorocast::tracking {
namespace {

using geometry::Mat3;
using geometry::Vec3;

/// One edge's points seen from both patches: p = T_k x − c_k, q = T_l M_kl x − c_l, d = c_k − c_l, so that r = p − q + d.
struct EdgeTerms {
  double mass;
  Vec3 p;  // mean of p
  Vec3 q;  // mean of q
  Vec3 d;
  Mat3 pp;  // Σ mass p pᵀ
  Mat3 qq;
  Mat3 pq;

  double Energy() const { return pp.trace() + qq.trace() - 2 * pq.trace() + mass * (2 * d.dot(p - q) + d.squaredNorm()); }
};

EdgeTerms TermsOf(const PatchModel& model, const PatchEdge& edge, const Pose& pose, const Relation& relation) {
  const geometry::Rigid3& tk = pose[edge.k];
  const geometry::Rigid3& tl = pose[edge.l];
  const Vec3 ck = tk * model.centre[edge.k];
  const Vec3 cl = tl * model.centre[edge.l];
  const Mat3 rk = tk.rotation.toRotationMatrix();
  const Mat3 rl = tl.rotation.toRotationMatrix() * relation.matrix;
  EdgeTerms t;
  t.mass = edge.mass;
  t.p = tk * edge.mean - ck;
  t.q = tl * (relation.matrix * edge.mean + relation.offset) - cl;
  t.d = ck - cl;
  const Mat3 rk_s = rk * edge.covariance;
  t.pp = rk_s * rk.transpose() + edge.mass * t.p * t.p.transpose();
  t.pq = rk_s * rl.transpose() + edge.mass * t.p * t.q.transpose();
  t.qq = rl * edge.covariance * rl.transpose() + edge.mass * t.q * t.q.transpose();
  return t;
}

/// Σ mass p × q from Σ mass p qᵀ.
Vec3 CrossOf(const Mat3& pq) { return {pq(1, 2) - pq(2, 1), pq(2, 0) - pq(0, 2), pq(0, 1) - pq(1, 0)}; }

void AddOwnBlock(const Mat3& square, const Vec3& mean, double mass, double weight, Matrix6& h) {
  h.topLeftCorner<3, 3>() += weight * (square.trace() * Mat3::Identity() - square);
  h.topRightCorner<3, 3>() += weight * mass * Cross(mean);
  h.bottomLeftCorner<3, 3>() += weight * mass * Cross(mean).transpose();
  h.bottomRightCorner<3, 3>() += weight * mass * Mat3::Identity();
}

}  // namespace

std::vector<Relation> RelationsOf(const PatchModel& model, const Pose& pose) {
  std::vector<Relation> relations;
  relations.reserve(model.edges.size());
  for (const PatchEdge& edge : model.edges) {
    const geometry::Rigid3 relation = pose[edge.l].Inverse() * pose[edge.k];
    relations.push_back({relation.rotation.toRotationMatrix(), relation.translation});
  }
  return relations;
}

double PoseDistance(const PatchModel& model, const Pose& pose, const std::vector<Relation>& reference) {
  double distance = 0;
  for (std::size_t e = 0; e < model.edges.size(); ++e) distance += TermsOf(model, model.edges[e], pose, reference[e]).Energy();
  return distance;
}

void AddPoseDistance(const PatchModel& model, const Pose& pose, const std::vector<Relation>& reference, double weight, NormalEquations& equations) {
  for (std::size_t e = 0; e < model.edges.size(); ++e) {
    const PatchEdge& edge = model.edges[e];
    const EdgeTerms t = TermsOf(model, edge, pose, reference[e]);
    AddOwnBlock(t.pp, t.p, t.mass, weight, equations.Diagonal(edge.k));
    AddOwnBlock(t.qq, t.q, t.mass, weight, equations.Diagonal(edge.l));

    // J_k = [−[p]×, I], J_l = [[q]×, −I]; the stored block is Σ J_lᵀ J_k.
    Matrix6& lower = equations.Lower(e);
    lower.topLeftCorner<3, 3>() += weight * (t.pq - t.pq.trace() * Mat3::Identity());
    lower.topRightCorner<3, 3>() += weight * t.mass * Cross(t.q).transpose();
    lower.bottomLeftCorner<3, 3>() += weight * t.mass * Cross(t.p);
    lower.bottomRightCorner<3, 3>() -= weight * t.mass * Mat3::Identity();

    const Vec3 p_cross_q = CrossOf(t.pq);
    const Vec3 sum = t.mass * (t.p - t.q + t.d);
    equations.Gradient(edge.k).head<3>() += weight * (t.mass * t.p.cross(t.d) - p_cross_q);
    equations.Gradient(edge.k).tail<3>() += weight * sum;
    equations.Gradient(edge.l).head<3>() += weight * (p_cross_q - t.mass * t.q.cross(t.d));
    equations.Gradient(edge.l).tail<3>() -= weight * sum;
  }
}

}  // namespace vorocast::tracking
