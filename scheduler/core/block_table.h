// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace vorocast::core {

/// A growing table in blocks: elements never move, growth copies nothing, and a block is given back once all of its elements are forgotten.
/// Indices are never used again.
template <typename Element>
class BlockTable {
 public:
  std::size_t size() const { return size_; }
  Element& operator[](std::size_t index) { return blocks_[index / kBlock]->elements[index % kBlock]; }
  const Element& operator[](std::size_t index) const { return blocks_[index / kBlock]->elements[index % kBlock]; }

  void push_back(Element element) {
    if (size_ % kBlock == 0) blocks_.push_back(std::make_unique<Block>());
    Block& block = *blocks_.back();
    block.elements.push_back(std::move(element));
    ++block.kept;
    ++size_;
  }

  /// Must not have been forgotten before.
  void Forget(std::size_t index) {
    std::unique_ptr<Block>& block = blocks_[index / kBlock];
    block->elements[index % kBlock] = Element{};
    // The last block stays: more are added to it.
    if (--block->kept == 0 && block->elements.size() == kBlock) block.reset();
  }
  /// Whether the element's block is still there; an element may be there and forgotten.
  bool HasBlock(std::size_t index) const { return blocks_[index / kBlock] != nullptr; }

 private:
  static constexpr std::size_t kBlock = 1024;
  struct Block {
    Block() { elements.reserve(kBlock); }
    std::vector<Element> elements;  // never grows past what was reserved
    std::size_t kept = 0;
  };
  std::vector<std::unique_ptr<Block>> blocks_;
  std::size_t size_ = 0;
};

}  // namespace vorocast::core
