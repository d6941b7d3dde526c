// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <BulletCollision/BroadphaseCollision/btBroadphaseInterface.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>

#include <cstdint>
#include <deque>
#include <vector>

namespace vorocast::simulation {

/// The pairs that may touch, in ascending order of the proxies' ids: a plain sorted list, so that nothing depends on addresses.
class PairList : public btOverlappingPairCache {
 public:
  /// Makes the list hold exactly `pairs` (sorted); those that were there keep what Bullet knows of them.
  void Replace(const std::vector<btBroadphasePair>& pairs, btDispatcher* dispatcher);

  btBroadphasePair* getOverlappingPairArrayPtr() override { return pairs_.size() > 0 ? &pairs_[0] : nullptr; }
  const btBroadphasePair* getOverlappingPairArrayPtr() const override { return pairs_.size() > 0 ? &pairs_[0] : nullptr; }
  btBroadphasePairArray& getOverlappingPairArray() override { return pairs_; }
  int getNumOverlappingPairs() const override { return pairs_.size(); }
  void cleanOverlappingPair(btBroadphasePair& pair, btDispatcher* dispatcher) override;
  void cleanProxyFromPairs(btBroadphaseProxy* proxy, btDispatcher* dispatcher) override;
  void removeOverlappingPairsContainingProxy(btBroadphaseProxy* proxy, btDispatcher* dispatcher) override;
  void processAllOverlappingPairs(btOverlapCallback* callback, btDispatcher* dispatcher) override;
  bool needsBroadphaseCollision(btBroadphaseProxy* a, btBroadphaseProxy* b) const override;
  bool hasDeferredRemoval() override { return false; }

  // Bullet asks for these only with ghost objects and other broadphases.
  btBroadphasePair* addOverlappingPair(btBroadphaseProxy*, btBroadphaseProxy*) override { return nullptr; }
  void* removeOverlappingPair(btBroadphaseProxy*, btBroadphaseProxy*, btDispatcher*) override { return nullptr; }
  btBroadphasePair* findPair(btBroadphaseProxy*, btBroadphaseProxy*) override { return nullptr; }
  btOverlapFilterCallback* getOverlapFilterCallback() override { return nullptr; }
  void setOverlapFilterCallback(btOverlapFilterCallback*) override {}
  void setInternalGhostPairCallback(btOverlappingPairCallback*) override {}
  void sortOverlappingPairs(btDispatcher*) override {}

 private:
  btBroadphasePairArray pairs_;
  btBroadphasePairArray next_;
};

/// A broadphase for thousands of lumps of about one size, all moving: at every step the lumps are sorted into a grid of cubes as large as the
/// largest, and two whose spheres and boxes meet, now or within the step, are a pair. Three times as fast as Bullet's trees on a heap of cells, where
/// nearly every leaf moves at every step. The few other bodies (scene objects, the ground, cells far larger than the rest) are tried against
/// everything.
class NearPairBroadphase : public btBroadphaseInterface {
 public:
  /// Bodies that meet within this many seconds, should they go on as they are, are near each other. 0: only those that meet now.
  void LookAhead(double seconds) { look_ahead_ = static_cast<float>(seconds); }
  /// Bodies whose user indices are partners ([n] lists) are never near each other.
  void LetPartnersOverlap(const std::vector<std::vector<std::int32_t>>* partners) { partners_ = partners; }
  btBroadphaseProxy* createProxy(const btVector3& aabb_min, const btVector3& aabb_max, int shape_type, void* object, int group, int mask,
                                 btDispatcher* dispatcher) override;
  void destroyProxy(btBroadphaseProxy* proxy, btDispatcher* dispatcher) override;
  void setAabb(btBroadphaseProxy* proxy, const btVector3& aabb_min, const btVector3& aabb_max, btDispatcher* dispatcher) override;
  void getAabb(btBroadphaseProxy* proxy, btVector3& aabb_min, btVector3& aabb_max) const override;
  void calculateOverlappingPairs(btDispatcher* dispatcher) override;
  btOverlappingPairCache* getOverlappingPairCache() override { return &pairs_; }
  const btOverlappingPairCache* getOverlappingPairCache() const override { return &pairs_; }
  void getBroadphaseAabb(btVector3& aabb_min, btVector3& aabb_max) const override;
  void aabbTest(const btVector3& aabb_min, const btVector3& aabb_max, btBroadphaseAabbCallback& callback) override;
  /// Nothing here casts rays.
  void rayTest(const btVector3&, const btVector3&, btBroadphaseRayCallback&, const btVector3&, const btVector3&) override {}
  void printStats() override {}

 private:
  struct Proxy : btBroadphaseProxy {
    float radius = 0;  // of the sphere about the body's origin that holds a cell; 0 for what is no cell
  };
  /// A proxy's place in this step's grid.
  struct Entry {
    float x, y, z, radius;
    btVector3 way;  // that it goes in the step
    float turn;     // the most that its turning moves any of its points by
    std::int32_t cube[3];
    std::int32_t order;  // in proxies_
    bool gridded;
  };

  void FillGrid();
  void SetWay(const Proxy& proxy, Entry& entry) const;
  bool ArePartners(const btBroadphaseProxy& a, const btBroadphaseProxy& b) const;
  void FindNeighbours(std::int32_t order, std::vector<std::int32_t>& neighbours) const;

  const std::vector<std::vector<std::int32_t>>* partners_ = nullptr;
  PairList pairs_;
  std::deque<Proxy> pool_;  // proxies never move
  std::vector<Proxy*> free_;
  std::vector<Proxy*> proxies_;  // ascending ids
  int last_id_ = 0;
  float look_ahead_ = 0;

  // Of the step at hand; members only to keep their memory.
  std::vector<Entry> entries_;        // as proxies_
  std::vector<std::int32_t> large_;   // orders of what is not in the grid
  std::vector<std::int32_t> bucket_;  // [buckets+1] first entry of each bucket in sorted_
  std::vector<Entry> sorted_;
  std::vector<btBroadphasePair> found_;
  std::uint32_t bucket_mask_ = 0;
};

}  // namespace vorocast::simulation
