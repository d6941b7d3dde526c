// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/heat.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::Cells;
using geometry::Vec3;
using Weights = HeatGraph::Weights;

/// A connected graph of n cells with random areas, distances and volumes.
struct Graph {
  std::vector<CellEdge> edges;
  std::vector<double> volume;
};
Graph RandomGraph(int n, int more_edges, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(0.2, 1.8);
  Graph graph;
  for (int c = 0; c < n; ++c) graph.volume.push_back(share(random) * 1e-4);
  for (int c = 1; c < n; ++c) graph.edges.push_back({.a = static_cast<std::int32_t>(random() % c), .b = c, .face_centre = Vec3::Zero()});
  for (int e = 0; e < more_edges; ++e) {
    const auto a = static_cast<std::int32_t>(random() % n);
    const auto b = static_cast<std::int32_t>(random() % n);
    if (a != b) graph.edges.push_back({.a = std::min(a, b), .b = std::max(a, b), .face_centre = Vec3::Zero()});
  }
  for (CellEdge& edge : graph.edges) {
    edge.area = share(random) * 1e-3;
    edge.distance = share(random) * 0.03;
  }
  return graph;
}

/// exp(−τ M⁻¹ L) F by the eigenvectors of the dense symmetric form.
std::vector<double> Exact(const Graph& graph, Weights weights, const std::vector<double>& f, double tau) {
  const auto n = static_cast<Eigen::Index>(graph.volume.size());
  Eigen::MatrixXd laplacian = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd mass = Eigen::VectorXd::Ones(n);
  double mean_weight = 0;
  for (const CellEdge& edge : graph.edges) mean_weight += edge.area / edge.distance / static_cast<double>(graph.edges.size());
  const double mean_volume = std::accumulate(graph.volume.begin(), graph.volume.end(), 0.0) / static_cast<double>(n);
  for (const CellEdge& edge : graph.edges) {
    const double w = weights == Weights::kGraph ? 1 : edge.area / edge.distance / mean_weight;
    laplacian(edge.a, edge.a) += w;
    laplacian(edge.b, edge.b) += w;
    laplacian(edge.a, edge.b) -= w;
    laplacian(edge.b, edge.a) -= w;
  }
  if (weights == Weights::kGeometric) {
    for (Eigen::Index c = 0; c < n; ++c) mass[c] = graph.volume[static_cast<std::size_t>(c)] / mean_volume;
  }
  const Eigen::VectorXd root = mass.cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(root.cwiseInverse().asDiagonal() * laplacian * root.cwiseInverse().asDiagonal());
  const Eigen::VectorXd y = root.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(f.data(), n));
  const Eigen::VectorXd decayed = (-tau * solver.eigenvalues().array()).exp().matrix().cwiseProduct(solver.eigenvectors().transpose() * y);
  const Eigen::VectorXd x = root.cwiseInverse().cwiseProduct(solver.eigenvectors() * decayed);
  return {x.data(), x.data() + n};
}

TEST(Heat, IsTheMatrixExponential) {
  for (const Weights weights : {Weights::kGraph, Weights::kGeometric}) {
    for (const unsigned seed : {1U, 2U, 3U}) {
      const Graph graph = RandomGraph(40, 120, seed);
      const HeatGraph heat(graph.edges, graph.volume, weights);
      std::vector<double> start(40, 0);
      start[3] = 1;
      start[17] = 0.25;
      for (const double tau : {0.0, 1e-9, 1e-3, 0.1, 1.0, 10.0, 300.0}) {
        const std::vector<double> result = heat.Diffuse(start, tau);
        const std::vector<double> exact = Exact(graph, weights, start, tau);
        for (std::size_t c = 0; c < start.size(); ++c) EXPECT_NEAR(result[c], exact[c], 1e-12) << "tau " << tau << ", cell " << c;
      }
    }
  }
}

/// Two cells: the difference decays as e^−2τ.
TEST(Heat, TwoCellsShare) {
  const HeatGraph heat({{.a = 0, .b = 1, .area = 1, .distance = 1, .face_centre = Vec3::Zero()}}, {1, 1}, Weights::kGraph);
  const std::vector<double> result = heat.Diffuse({1, 0}, 0.7);
  EXPECT_NEAR(result[0], 0.5 + 0.5 * std::exp(-1.4), 1e-14);
  EXPECT_NEAR(result[1], 0.5 - 0.5 * std::exp(-1.4), 1e-14);
}

TEST(Heat, ManyStepsAreOneStepAndHeatIsKept) {
  const Graph graph = RandomGraph(60, 150, 7);
  const HeatGraph heat(graph.edges, graph.volume, Weights::kGeometric);
  std::vector<double> start(60, 0);
  start[0] = 1;
  std::vector<double> steps = start;
  for (int i = 0; i < 50; ++i) steps = heat.Diffuse(steps, 0.1);
  const std::vector<double> once = heat.Diffuse(start, 5);
  double content = 0;
  for (std::size_t c = 0; c < 60; ++c) {
    EXPECT_NEAR(steps[c], once[c], 1e-13);
    content += graph.volume[c] * once[c];
  }
  EXPECT_NEAR(content, graph.volume[0], 1e-16);
}

TEST(Heat, NeverLeaksBetweenComponents) {
  Cells cells = testing::CubeBlock(3, 4, 3, 0.04);
  const std::size_t first = cells.size();
  const Cells far = testing::CubeBlock(2, 2, 2, 0.04, 5);
  for (const Vec3& centre : far.centroid) testing::AddCell(cells, testing::CubeCell(0.04), centre);
  testing::ConnectNeighbours(cells);
  const HeatGraph heat(CellEdges(cells), cells.volume, Weights::kGeometric);
  std::vector<double> start(cells.size(), 0);
  start[0] = 1;
  const std::vector<double> result = heat.Diffuse(start, 1e4);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (c < first) {
      EXPECT_NEAR(result[c], 1.0 / static_cast<double>(first), 1e-12);
    } else {
      EXPECT_EQ(result[c], 0);
    }
  }
}

/// A rod held hot at one end: in the end all of it is; before, what the sine series of ∂T/∂τ = T'' on a chain gives (eigenvalues 2 − 2 cos θ).
TEST(Heat, HeldSourcesStayHot) {
  constexpr int kN = 12;
  std::vector<CellEdge> edges;
  for (std::int32_t c = 1; c < kN; ++c) edges.push_back({.a = c - 1, .b = c, .area = 1, .distance = 1, .face_centre = Vec3::Zero()});
  const HeatGraph heat(edges, std::vector<double>(kN, 1), Weights::kGraph);
  std::vector<double> start(kN, 0);
  std::vector<bool> held(kN, false);
  start[0] = 1;
  held[0] = true;
  const double tau = 9;
  const std::vector<double> result = heat.Diffuse(start, tau, held);
  // Cells 1 … N−1 with nothing at cell 0 and no flow beyond cell N−1: modes sin(k θ), θ = (j + ½) π / (N − ½).
  constexpr int kFree = kN - 1;
  for (int k = 0; k < kN; ++k) {
    double lacks = 0;
    for (int j = 0; j < kFree; ++j) {
      const double theta = (j + 0.5) * std::numbers::pi / (kFree + 0.5);
      double norm = 0;
      double amount = 0;
      for (int i = 1; i <= kFree; ++i) {
        norm += std::pow(std::sin(i * theta), 2);
        amount += std::sin(i * theta);
      }
      lacks += amount / norm * std::exp(-tau * (2 - 2 * std::cos(theta))) * std::sin(k * theta);
    }
    EXPECT_NEAR(result[static_cast<std::size_t>(k)], 1 - lacks, 1e-12) << k;
  }
  for (const double t : heat.Diffuse(start, 1e5, held)) EXPECT_NEAR(t, 1, 1e-12);
}

TEST(CellGraph, CubesHaveSquareFacesBetweenThem) {
  Cells cells = testing::CubeBlock(3, 2, 1, 0.04);
  testing::ConnectNeighbours(cells);
  const std::vector<CellEdge> edges = CellEdges(cells);
  EXPECT_EQ(edges.size(), 7U);
  for (const CellEdge& edge : edges) {
    EXPECT_LT(edge.a, edge.b);
    EXPECT_NEAR(edge.area, 0.0016, 1e-12);
    EXPECT_NEAR(edge.distance, 0.04, 1e-12);
    EXPECT_LT((edge.face_centre - 0.5 * (cells.centroid[edge.a] + cells.centroid[edge.b])).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace vorocast::simulation
