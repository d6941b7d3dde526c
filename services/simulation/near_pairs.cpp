// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/near_pairs.h"

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace vorocast::simulation {
namespace {

constexpr float kPad = 0.1F;          // Bullet units; contacts form up to a few hundredths apart
constexpr float kWayMax = 5;          // Bullet units: what goes farther in a step does not make the grid any coarser
constexpr float kLargeByMean = 2.5F;  // a cell with a radius of this many times the mean would make the grid too coarse

float Square(float x) { return x * x; }

bool Before(const btBroadphasePair& a, const btBroadphasePair& b) {
  if (a.m_pProxy0->m_uniqueId != b.m_pProxy0->m_uniqueId) return a.m_pProxy0->m_uniqueId < b.m_pProxy0->m_uniqueId;
  return a.m_pProxy1->m_uniqueId < b.m_pProxy1->m_uniqueId;
}

bool FilterLets(const btBroadphaseProxy& a, const btBroadphaseProxy& b) {
  return (a.m_collisionFilterGroup & b.m_collisionFilterMask) != 0 && (b.m_collisionFilterGroup & a.m_collisionFilterMask) != 0;
}

bool BoxesMeet(const btBroadphaseProxy& a, const btBroadphaseProxy& b) {
  for (int axis = 0; axis < 3; ++axis) {
    if (a.m_aabbMin[axis] > b.m_aabbMax[axis] || b.m_aabbMin[axis] > a.m_aabbMax[axis]) return false;
  }
  return true;
}

/// Whether two boxes meet while b goes `way` as seen from a, and anything may be nearer by `slack`.
bool BoxesMeet(const btBroadphaseProxy& a, const btBroadphaseProxy& b, const btVector3& way, float slack) {
  for (int axis = 0; axis < 3; ++axis) {
    if (a.m_aabbMin[axis] > b.m_aabbMax[axis] + std::max(way[axis], 0.0F) + slack) return false;
    if (b.m_aabbMin[axis] + std::min(way[axis], 0.0F) - slack > a.m_aabbMax[axis]) return false;
  }
  return true;
}

/// Written by every step, so that a scattered cell far away cannot make it large.
std::uint32_t Hash(std::int32_t x, std::int32_t y, std::int32_t z) {
  return static_cast<std::uint32_t>(x) * 73856093U ^ static_cast<std::uint32_t>(y) * 19349663U ^ static_cast<std::uint32_t>(z) * 83492791U;
}

}  // namespace

void PairList::cleanOverlappingPair(btBroadphasePair& pair, btDispatcher* dispatcher) {
  if (pair.m_algorithm == nullptr) return;
  pair.m_algorithm->~btCollisionAlgorithm();
  dispatcher->freeCollisionAlgorithm(pair.m_algorithm);
  pair.m_algorithm = nullptr;
}

void PairList::Replace(const std::vector<btBroadphasePair>& pairs, btDispatcher* dispatcher) {
  next_.resizeNoInitialize(0);
  next_.reserve(static_cast<int>(pairs.size()));
  int old = 0;
  for (const btBroadphasePair& pair : pairs) {
    for (; old < pairs_.size() && Before(pairs_[old], pair); ++old) cleanOverlappingPair(pairs_[old], dispatcher);
    const bool known = old < pairs_.size() && pairs_[old].m_pProxy0 == pair.m_pProxy0 && pairs_[old].m_pProxy1 == pair.m_pProxy1;
    next_.push_back(known ? pairs_[old++] : pair);
  }
  for (; old < pairs_.size(); ++old) cleanOverlappingPair(pairs_[old], dispatcher);
  pairs_ = next_;
}

void PairList::cleanProxyFromPairs(btBroadphaseProxy* proxy, btDispatcher* dispatcher) {
  for (int i = 0; i < pairs_.size(); ++i) {
    if (pairs_[i].m_pProxy0 == proxy || pairs_[i].m_pProxy1 == proxy) cleanOverlappingPair(pairs_[i], dispatcher);
  }
}

void PairList::removeOverlappingPairsContainingProxy(btBroadphaseProxy* proxy, btDispatcher* dispatcher) {
  int kept = 0;
  for (int i = 0; i < pairs_.size(); ++i) {
    if (pairs_[i].m_pProxy0 == proxy || pairs_[i].m_pProxy1 == proxy) {
      cleanOverlappingPair(pairs_[i], dispatcher);
    } else {
      pairs_[kept++] = pairs_[i];
    }
  }
  pairs_.resizeNoInitialize(kept);
}

void PairList::processAllOverlappingPairs(btOverlapCallback* callback, btDispatcher* dispatcher) {
  int kept = 0;
  for (int i = 0; i < pairs_.size(); ++i) {
    if (callback->processOverlap(pairs_[i])) {
      cleanOverlappingPair(pairs_[i], dispatcher);
    } else if (kept++ != i) {
      pairs_[kept - 1] = pairs_[i];
    }
  }
  pairs_.resizeNoInitialize(kept);
}

bool PairList::needsBroadphaseCollision(btBroadphaseProxy* a, btBroadphaseProxy* b) const { return FilterLets(*a, *b); }

btBroadphaseProxy* NearPairBroadphase::createProxy(const btVector3& aabb_min, const btVector3& aabb_max, int shape_type, void* object, int group,
                                                   int mask, btDispatcher*) {
  if (free_.empty()) {
    pool_.emplace_back();
    free_.push_back(&pool_.back());
  }
  Proxy* proxy = free_.back();
  free_.pop_back();
  proxy->m_clientObject = object;
  proxy->m_collisionFilterGroup = group;
  proxy->m_collisionFilterMask = mask;
  proxy->m_aabbMin = aabb_min;
  proxy->m_aabbMax = aabb_max;
  proxy->m_uniqueId = ++last_id_;
  proxy->radius = 0;
  if (shape_type == CONVEX_HULL_SHAPE_PROXYTYPE) {
    const auto* hull = static_cast<const btConvexHullShape*>(static_cast<const btCollisionObject*>(object)->getCollisionShape());
    for (int i = 0; i < hull->getNumPoints(); ++i) proxy->radius = std::max(proxy->radius, hull->getUnscaledPoints()[i].length());
    proxy->radius += hull->getMargin();
  }
  proxies_.push_back(proxy);
  return proxy;
}

void NearPairBroadphase::destroyProxy(btBroadphaseProxy* proxy, btDispatcher* dispatcher) {
  pairs_.removeOverlappingPairsContainingProxy(proxy, dispatcher);
  const auto by_id = [](const Proxy* p) { return p->m_uniqueId; };
  const auto found = std::ranges::lower_bound(proxies_, proxy->m_uniqueId, {}, by_id);
  free_.push_back(*found);
  proxies_.erase(found);
}

void NearPairBroadphase::setAabb(btBroadphaseProxy* proxy, const btVector3& aabb_min, const btVector3& aabb_max, btDispatcher*) {
  proxy->m_aabbMin = aabb_min;
  proxy->m_aabbMax = aabb_max;
}

void NearPairBroadphase::getAabb(btBroadphaseProxy* proxy, btVector3& aabb_min, btVector3& aabb_max) const {
  aabb_min = proxy->m_aabbMin;
  aabb_max = proxy->m_aabbMax;
}

void NearPairBroadphase::getBroadphaseAabb(btVector3& aabb_min, btVector3& aabb_max) const {
  aabb_min.setValue(-BT_LARGE_FLOAT, -BT_LARGE_FLOAT, -BT_LARGE_FLOAT);
  aabb_max.setValue(BT_LARGE_FLOAT, BT_LARGE_FLOAT, BT_LARGE_FLOAT);
}

void NearPairBroadphase::aabbTest(const btVector3& aabb_min, const btVector3& aabb_max, btBroadphaseAabbCallback& callback) {
  const btBroadphaseProxy box(aabb_min, aabb_max, nullptr, 0, 0);
  for (const Proxy* proxy : proxies_) {
    if (BoxesMeet(*proxy, box)) callback.process(proxy);
  }
}

void NearPairBroadphase::SetWay(const Proxy& proxy, Entry& entry) const {
  entry.way.setZero();
  entry.turn = 0;
  const auto* body = btRigidBody::upcast(static_cast<const btCollisionObject*>(proxy.m_clientObject));
  if (body == nullptr || (body->isStaticObject() && !body->isKinematicObject()) || look_ahead_ == 0) return;
  entry.way = look_ahead_ * body->getLinearVelocity();
  const float radius = proxy.radius > 0 ? proxy.radius : 0.5F * (proxy.m_aabbMax - proxy.m_aabbMin).length();
  entry.turn = look_ahead_ * radius * body->getAngularVelocity().length();
}

void NearPairBroadphase::FillGrid() {
  double radius_sum = 0;
  int cells = 0;
  for (const Proxy* proxy : proxies_) {
    radius_sum += proxy->radius;
    cells += proxy->radius > 0;
  }
  const float largest = cells > 0 ? kLargeByMean * static_cast<float>(radius_sum / cells) : 0;
  entries_.clear();
  large_.clear();
  float radius_max = 0;
  btVector3 slowest(BT_LARGE_FLOAT, BT_LARGE_FLOAT, BT_LARGE_FLOAT);
  btVector3 fastest = -slowest;
  for (std::size_t i = 0; i < proxies_.size(); ++i) {
    const Proxy& proxy = *proxies_[i];
    const btVector3& origin = static_cast<const btCollisionObject*>(proxy.m_clientObject)->getWorldTransform().getOrigin();
    const bool gridded = proxy.radius > 0 && proxy.radius <= largest;
    entries_.push_back({origin.x(), origin.y(), origin.z(), proxy.radius, {0, 0, 0}, 0, {0, 0, 0}, static_cast<std::int32_t>(i), gridded});
    SetWay(proxy, entries_.back());
    if (gridded) {
      radius_max = std::max(radius_max, proxy.radius);
      slowest.setMin(entries_.back().way);
      fastest.setMax(entries_.back().way);
    } else {
      large_.push_back(static_cast<std::int32_t>(i));
    }
  }
  // What all have in common brings none nearer to another.
  const float way_max = fastest.x() < slowest.x() ? 0 : std::min((fastest - slowest).length(), kWayMax);
  const float inverse_edge = 1 / (2 * radius_max + kPad + way_max);
  bucket_mask_ = std::bit_ceil(static_cast<std::uint32_t>(2 * entries_.size() + 1)) - 1;
  bucket_.assign(bucket_mask_ + 2, 0);
  constexpr float kFarthest = 1e9F;  // cubes away; keeps the cast within int
  for (Entry& entry : entries_) {
    if (!entry.gridded) continue;
    const float place[3] = {entry.x, entry.y, entry.z};
    for (int axis = 0; axis < 3; ++axis)
      entry.cube[axis] = static_cast<std::int32_t>(std::clamp(std::floor(place[axis] * inverse_edge), -kFarthest, kFarthest));
    ++bucket_[(Hash(entry.cube[0], entry.cube[1], entry.cube[2]) & bucket_mask_) + 1];
  }
  for (std::size_t b = 1; b < bucket_.size(); ++b) bucket_[b] += bucket_[b - 1];
  sorted_.resize(entries_.size() - large_.size());
  // Filled from the back, so that each bucket's first index ends up where it belongs and entries keep their order.
  for (std::size_t i = entries_.size(); i-- > 0;) {
    const Entry& entry = entries_[i];
    if (entry.gridded) sorted_[static_cast<std::size_t>(--bucket_[(Hash(entry.cube[0], entry.cube[1], entry.cube[2]) & bucket_mask_) + 1])] = entry;
  }
}

bool NearPairBroadphase::ArePartners(const btBroadphaseProxy& a, const btBroadphaseProxy& b) const {
  if (partners_ == nullptr || partners_->empty()) return false;
  const int index_a = static_cast<const btCollisionObject*>(a.m_clientObject)->getUserIndex();
  const int index_b = static_cast<const btCollisionObject*>(b.m_clientObject)->getUserIndex();
  if (index_a < 0 || index_b < 0) return false;
  const std::vector<std::int32_t>& partners = (*partners_)[static_cast<std::size_t>(index_a)];
  return std::ranges::find(partners, index_b) != partners.end();
}

/// Later proxies that the given one may touch, ascending.
void NearPairBroadphase::FindNeighbours(std::int32_t order, std::vector<std::int32_t>& neighbours) const {
  neighbours.clear();
  const Entry& own = entries_[static_cast<std::size_t>(order)];
  const Proxy& proxy = *proxies_[static_cast<std::size_t>(order)];
  const auto try_box = [&](std::int32_t other) {
    const Proxy& other_proxy = *proxies_[static_cast<std::size_t>(other)];
    const Entry& entry = entries_[static_cast<std::size_t>(other)];
    if (FilterLets(proxy, other_proxy) && BoxesMeet(proxy, other_proxy, entry.way - own.way, own.turn + entry.turn) &&
        !ArePartners(proxy, other_proxy))
      neighbours.push_back(other);
  };
  if (!own.gridded) {
    for (auto other = order + 1; other < static_cast<std::int32_t>(entries_.size()); ++other) try_box(other);
    return;
  }
  for (const std::int32_t other : large_) {
    if (other > order) try_box(other);
  }
  for (std::int32_t dz = -1; dz <= 1; ++dz) {
    for (std::int32_t dy = -1; dy <= 1; ++dy) {
      for (std::int32_t dx = -1; dx <= 1; ++dx) {
        const std::int32_t cube[3] = {own.cube[0] + dx, own.cube[1] + dy, own.cube[2] + dz};
        const std::uint32_t bucket = Hash(cube[0], cube[1], cube[2]) & bucket_mask_;
        // After filling, bucket b starts at bucket_[b + 1] and ends where the next one starts.
        const std::int32_t first = bucket_[bucket + 1];
        const std::int32_t last = bucket + 2 < bucket_.size() ? bucket_[bucket + 2] : static_cast<std::int32_t>(sorted_.size());
        for (std::int32_t s = first; s < last; ++s) {
          const Entry& other = sorted_[static_cast<std::size_t>(s)];
          if (other.order <= order || other.cube[0] != cube[0] || other.cube[1] != cube[1] || other.cube[2] != cube[2]) continue;
          const float x = own.x - other.x;
          const float y = own.y - other.y;
          const float z = own.z - other.z;
          const float reach = own.radius + other.radius + kPad;
          const float squared = x * x + y * y + z * z;
          if (squared <= reach * reach || squared <= Square(reach + (other.way - own.way).length())) try_box(other.order);
        }
      }
    }
  }
  std::ranges::sort(neighbours);
}

void NearPairBroadphase::calculateOverlappingPairs(btDispatcher* dispatcher) {
  FillGrid();
  found_.clear();
  std::vector<std::int32_t> neighbours;
  for (std::size_t i = 0; i < proxies_.size(); ++i) {
    FindNeighbours(static_cast<std::int32_t>(i), neighbours);
    for (const std::int32_t j : neighbours) found_.emplace_back(*proxies_[i], *proxies_[static_cast<std::size_t>(j)]);
  }
  pairs_.Replace(found_, dispatcher);
}

}  // namespace vorocast::simulation
