// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/artifact_file.h"

#include <fmt/format.h>

namespace vorocast::storage {
namespace {

/// The content name, once format and version are known to be right.
absl::StatusOr<std::string> CheckRoot(const Hdf5Reader& reader) {
  ASSIGN_OR_RETURN(const std::string format, reader.TextAttribute("/", "format"));
  if (format != kFormatName) return reader.Wrong("/@format", "this is not a Vorocast file");
  ASSIGN_OR_RETURN(const std::int32_t version, reader.Attribute<std::int32_t>("/", "format_version"));
  if (version != kFormatVersion) {
    return reader.Wrong("/@format_version", fmt::format("the file has version {}, this program reads version {}", version, kFormatVersion));
  }
  return reader.TextAttribute("/", "content");
}

}  // namespace

void WriteRoot(Hdf5Writer& writer, std::string_view content, const Provenance& provenance) {
  writer.Attribute("/", "format", std::string(kFormatName));
  writer.Attribute("/", "format_version", kFormatVersion);
  writer.Attribute("/", "content", std::string(content));
  writer.Attribute("/", "kind", provenance.kind);
  writer.Attribute("/", "key", provenance.key);
  writer.Attribute("/", "kernel_version", std::int32_t{provenance.kernel_version});
  writer.Attribute("/", "options", provenance.options_json);
  writer.Attribute("/", "seed", provenance.seed);
  writer.Attribute("/", "inputs", provenance.inputs);
}

absl::StatusOr<Hdf5Reader> OpenArtifact(const std::filesystem::path& path, std::string_view content) {
  ASSIGN_OR_RETURN(Hdf5Reader reader, Hdf5Reader::Open(path));
  ASSIGN_OR_RETURN(const std::string found, CheckRoot(reader));
  if (found != content) return reader.Wrong("/@content", fmt::format("the file holds \"{}\", not \"{}\"", found, content));
  return reader;
}

absl::StatusOr<std::string> ReadContent(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, Hdf5Reader::Open(path));
  return CheckRoot(reader);
}

absl::Status RefuseToWrite(const std::filesystem::path& path, const std::string& fault) {
  if (fault.empty()) return absl::OkStatus();
  return absl::InternalError(fmt::format("{}: not written: {}", path.string(), fault));
}

absl::StatusOr<Provenance> ReadProvenance(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, Hdf5Reader::Open(path));
  RETURN_IF_ERROR(CheckRoot(reader).status());
  Provenance provenance;
  ASSIGN_OR_RETURN(provenance.kind, reader.TextAttribute("/", "kind"));
  ASSIGN_OR_RETURN(provenance.key, reader.TextAttribute("/", "key"));
  ASSIGN_OR_RETURN(provenance.kernel_version, reader.Attribute<std::int32_t>("/", "kernel_version"));
  ASSIGN_OR_RETURN(provenance.options_json, reader.TextAttribute("/", "options"));
  ASSIGN_OR_RETURN(provenance.seed, reader.Attribute<std::uint64_t>("/", "seed"));
  ASSIGN_OR_RETURN(provenance.inputs, reader.ListAttribute("/", "inputs"));
  return provenance;
}

absl::Status CheckArtifact(const std::filesystem::path& path) {
  RETURN_IF_ERROR(ReadProvenance(path).status());
  ASSIGN_OR_RETURN(const std::string content, ReadContent(path));
  if (content == kCellsContent) return ReadCells(path).status();
  if (content == kTemplateContent) return ReadTemplate(path).status();
  if (content == kPosesContent) return ReadPoseTrack(path).status();
  if (content == kStretchContent) return ReadStretch(path).status();
  if (content == kTrackedContent) return ReadTrackedTake(path).status();
  if (content == kSimulatedContent) return ReadSimulatedTake(path).status();
  return absl::DataLossError(fmt::format("{}: /@content: the file holds \"{}\", which is unknown", path.string(), content));
}

}  // namespace vorocast::storage
