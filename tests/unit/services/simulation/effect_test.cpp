// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/effect.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <set>

#include "services/simulation/effect_settings.h"
#include "services/simulation/shipped_effects.h"

namespace vorocast::simulation {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string Refusal(const json& effect) {
  const auto result = NormaliseEffect(effect);
  EXPECT_FALSE(result.ok()) << effect;
  if (result.ok()) return "";
  EXPECT_EQ(result.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(result.status().message());
}

TEST(Effect, ShipsTheseByName) {
  EXPECT_THAT(ShippedEffects(), ElementsAre("calm", "colliders", "distortion", "erosion", "gravity_pull", "heat", "morph", "pendulum", "persistence",
                                            "release", "soft", "wind"));
}

TEST(Effect, ShippedOnesLoadAndAreTheFilesOfTheEffectsFolder) {
  for (const std::string& name : ShippedEffects()) {
    const auto embedded = LoadEffect(name);
    ASSERT_TRUE(embedded.ok()) << embedded.status();
    EXPECT_EQ((*embedded)["name"], name);
    EXPECT_FALSE((*embedded)["description"].get<std::string>().empty());
    const auto file = LoadEffect(std::string(VOROCAST_SOURCE_DIR) + "/effects/" + name + ".json");
    ASSERT_TRUE(file.ok()) << file.status();
    EXPECT_EQ(*embedded, *file);
  }
}

TEST(Effect, CanonicalFormIsCompleteAndStaysAsItIs) {
  for (const std::string& name : ShippedEffects()) {
    const json effect = *LoadEffect(name);
    EXPECT_EQ(*NormaliseEffect(effect), effect);
    EXPECT_EQ(NormaliseEffect(effect)->dump(), effect.dump());
  }
}

TEST(Effect, DefaultsAreFilledIn) {
  const json effect = *NormaliseEffect({{"name", "x"}});
  EXPECT_EQ(effect["gravity_m_s2"], 9.81);
  EXPECT_EQ(effect["recall"]["stiffness_s2"], 1000.0);
  EXPECT_EQ(effect["recall"]["damping_ratio"], 1.0);
  EXPECT_EQ(effect["ground"]["height_m"], "lowest");
  EXPECT_EQ(effect["rupture"]["acceleration_m_s2"], "never");
  EXPECT_EQ(effect["objects"], json::array());
}

TEST(Effect, OneEffectHasOneForm) {
  EXPECT_EQ(NormaliseEffect({{"name", "x"}, {"rate_hz", 120}})->dump(),
            NormaliseEffect({{"rate_hz", 120.0}, {"name", "x"}, {"ground", json::object()}})->dump());
  EXPECT_EQ(NormaliseEffect({{"name", "x"}, {"gravity_m_s2", -0.0}})->dump(), NormaliseEffect({{"name", "x"}, {"gravity_m_s2", 0}})->dump());
}

TEST(Effect, RefusalsNameTheFieldAndWhatItMayHold) {
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"kind", "ballon"}}}}}),
            "effect: objects[0].kind: \"ballon\" is none of box, sphere, wall, mesh, pendulum");
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"name", "b"}}}}}),
            "effect: objects[0].kind: missing; it must be one of box, sphere, wall, mesh, pendulum");
  EXPECT_EQ(Refusal({{"name", "x"}, {"recall", {{"stiffness_s2", "soft"}}}}),
            "effect: recall.stiffness_s2: \"soft\" is not a number from 0 to 1000000 or a list of key frames");
  EXPECT_EQ(Refusal({{"name", "x"}, {"recall", {{"stiffness_s2", -1}}}}),
            "effect: recall.stiffness_s2: -1 is not a number from 0 to 1000000 or a list of key frames");
  EXPECT_EQ(Refusal({{"name", "x"}, {"ground", {{"height_m", "low"}}}}),
            "effect: ground.height_m: \"low\" is not \"lowest\" or a number from -1000 to 1000");
  EXPECT_EQ(Refusal({{"name", "x"}, {"rupture", {{"acceleration_m_s2", 0}}}}),
            "effect: rupture.acceleration_m_s2: 0 is not \"never\" or a number above 0 and up to 1000000 or a list of key frames");
  EXPECT_EQ(Refusal({{"name", "x"}, {"ground", {{"enabled", 1}}}}), "effect: ground.enabled: 1 is not true or false");
  EXPECT_EQ(Refusal({{"name", ""}}), "effect: name: \"\" is not a text of 1 to 100 characters");
  EXPECT_EQ(Refusal(json::object()), "effect: name: missing; it must be a text of 1 to 100 characters");
  EXPECT_EQ(Refusal(json::array()), "effect: [] is not an object");
  EXPECT_EQ(Refusal({{"name", "x"}, {"cells", {{"colour", 1}}}}),
            "effect: cells.\"colour\": there is no such field; there are density_kg_m3, friction, restitution, shrink_m");
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"kind", "sphere"}}}}}),
            "effect: objects[0].position_m: missing; it must be a list of 3 items or a list of key frames");
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"kind", "sphere"}, {"position_m", {0, 1}}}}}}),
            "effect: objects[0].position_m: [0,1] is not a list of 3 items");
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"kind", "sphere"}, {"position_m", {0, 1, "a"}}}}}}),
            "effect: objects[0].position_m[2]: \"a\" is not a number from -1000 to 1000");
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"kind", "pendulum"}, {"pivot_m", {0, 1}}}}}}),
            "effect: objects[0].pivot_m: [0,1] is not a list of 3 items");
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"kind", "sphere"}, {"position_m", {0, 1, 0}}, {"motion", "flying"}}}}}),
            "effect: objects[0].motion: \"flying\" is none of loose, fixed, driven");
  EXPECT_EQ(Refusal({{"name", "x"}, {"release", {{{"by", "height"}, {"start_s", 2}, {"end_s", 1}}}}}),
            "effect: release[0].end_s: 1 is before start_s, 2");
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"kind", "pendulum"}}, {{"kind", "pendulum"}}}}}),
            "effect: objects[1].name: \"pendulum\" is another object's name already; give each its own");
}

TEST(Effect, KeyFramesAreCheckedAsPlainNumbersAre) {
  const auto keys = [](json list) { return json{{"name", "x"}, {"gravity_m_s2", std::move(list)}}; };
  EXPECT_TRUE(NormaliseEffect(keys({{{"t", 0}, {"value", 9.81}}, {{"t", 1}, {"value", -2}}})).ok());
  EXPECT_EQ(Refusal(keys({{{"t", 0}, {"value", 101}}})), "effect: gravity_m_s2[0].value: 101 is not a number from -100 to 100");
  EXPECT_EQ(Refusal(keys({{{"t", 1}, {"value", 1}}, {{"t", 1}, {"value", 2}}})),
            "effect: gravity_m_s2[1].t: 1.0 is not later than the key frame before, 1.0");
  EXPECT_EQ(Refusal(keys({{{"t", 1}}})), "effect: gravity_m_s2[0].value: missing; it must be a number from -1000000 to 1000000");
  EXPECT_EQ(Refusal(keys(json::array())), "effect: gravity_m_s2: [] is not a number from -100 to 100 or a list of key frames");
  const json moving = {{{"t", 0}, {"value", {0, 1, 0}}}, {{"t", 1}, {"value", {1, 1, 0}}}};
  EXPECT_EQ(Refusal({{"name", "x"}, {"objects", {{{"kind", "sphere"}, {"position_m", moving}}}}}),
            "effect: objects[0].motion: key frames in position_m move only what is \"driven\", not \"loose\"");
  EXPECT_TRUE(NormaliseEffect({{"name", "x"}, {"objects", {{{"kind", "sphere"}, {"position_m", moving}, {"motion", "driven"}}}}}).ok());
  EXPECT_EQ(Refusal({{"name", "x"}, {"recall", {{"mask", {{"patches", {1.5}}}}}}}),
            "effect: recall.mask.patches[0]: 1.5 is not a whole number from 0 to 1000000");
}

TEST(Effect, AMeshIsReadWhereTheEffectIsLoaded) {
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / "vorocast_mesh_effect";
  std::filesystem::create_directories(folder / "shapes");
  std::ofstream(folder / "shapes" / "tetrahedron.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  const json object = {{"kind", "mesh"}, {"position_m", {0, 0, 0}}, {"file", "shapes/tetrahedron.obj"}};
  std::ofstream(folder / "effect.json") << json{{"name", "x"}, {"objects", {object}}};
  const auto loaded = LoadEffect((folder / "effect.json").string());
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  const json& mesh = (*loaded)["objects"][0];
  EXPECT_EQ(mesh["file"], "");
  EXPECT_EQ(mesh["vertices"].size(), 4U);
  EXPECT_EQ(mesh["triangles"], json::parse("[[0,2,1],[0,1,3],[0,3,2],[1,2,3]]"));
  EXPECT_EQ(*NormaliseEffect(*loaded), *loaded);
  EXPECT_THAT(Refusal({{"name", "x"}, {"objects", {object}}}), HasSubstr("objects[0].file: a file is read where an effect is loaded"));
  json missing = object;
  missing["file"] = "no.obj";
  std::ofstream(folder / "missing.json") << json{{"name", "x"}, {"objects", {missing}}};
  EXPECT_THAT(std::string(LoadEffect((folder / "missing.json").string()).status().message()), HasSubstr("no.obj"));
  EXPECT_THAT(Refusal({{"name", "x"}, {"objects", {{{"kind", "mesh"}, {"position_m", {0, 0, 0}}}}}}), HasSubstr("needs a file, or vertices"));
  EXPECT_THAT(
      Refusal({{"name", "x"},
               {"objects",
                {{{"kind", "mesh"}, {"position_m", {0, 0, 0}}, {"vertices", {{0, 0, 0}, {1, 0, 0}}}, {"triangles", json::parse("[[0,1,2]]")}}}}}),
      HasSubstr("corner 2 is not there; there are 2"));
  std::filesystem::remove_all(folder);
}

TEST(Effect, TextThatIsNoJsonSaysWhere) {
  const auto result = ParseEffect("{\"name\": \"x\",\n \"rate_hz\": }");
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("line 2"));
  EXPECT_FALSE(ParseEffect("{\"name\": \"x\", \"rate_hz\": 1e999}").ok());
  EXPECT_FALSE(ParseEffect("{\"name\": \"\xff\"}").ok());
}

TEST(Effect, UnknownNameListsWhatShips) {
  const auto result = LoadEffect("pendulm");
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("calm, colliders, distortion, erosion"));
}

TEST(Effect, FileErrorNamesTheFile) {
  const std::filesystem::path path = std::filesystem::path(::testing::TempDir()) / "vorocast_effect_test.json";
  std::ofstream(path) << R"({"name": "x", "rate_hz": 1})";
  const auto result = LoadEffect(path.string());
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(std::string(result.status().message()), path.string() + ": effect: rate_hz: 1 is not a number from 10 to 10000");
  std::filesystem::remove(path);
}

/// Calls `visit` with every object schema that can be reached, as the value that holds just what it must and its place in the effect.
using Place = std::function<json(const json& object)>;  // puts an object where it belongs in a whole effect
const json& Resolve(const json& root, const json& schema) {
  if (schema.contains("allOf")) return Resolve(root, schema["allOf"][0]);
  return schema.contains("$ref") ? root.at(json::json_pointer(schema["$ref"].get<std::string>().substr(1))) : schema;
}
void VisitObjects(const json& root, const json& schema_or_ref, const Place& place, const std::function<void(const json&, const Place&)>& visit) {
  const json& schema = Resolve(root, schema_or_ref);
  if (schema.contains("oneOf")) {
    for (const json& alternative : schema["oneOf"]) VisitObjects(root, alternative, place, visit);
  }
  if (schema.value("type", "") == "array") {
    VisitObjects(
        root, schema["items"], [&](const json& item) { return place(json::array({item})); }, visit);
  }
  if (schema.value("type", "") != "object") return;
  visit(schema, place);
  for (const auto& [key, property] : schema["properties"].items()) {
    VisitObjects(
        root, property,
        [&, name = key](const json& value) {
          json object = json::object();
          for (const auto& required : schema.value("required", json::array())) {
            const json& needed = Resolve(root, schema["properties"][required.get<std::string>()]);
            object[required.get<std::string>()] = needed.contains("const")              ? needed["const"]
                                                  : needed.value("type", "") == "array" ? json({0, 0, 0})
                                                                                        : json("x");
          }
          if (object.value("kind", "") == "mesh") {
            object["vertices"] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
            object["triangles"] = json::parse("[[0,1,2]]");
          }
          object[name] = value;
          return place(object);
        },
        visit);
  }
}

TEST(EffectSchema, EveryPropertyIsKnownToTheParserAndNothingElseIs) {
  const json schema = json::parse(EffectSchemaText());
  int objects = 0;
  int properties = 0;
  VisitObjects(
      schema, schema, [](const json& whole) { return whole; },
      [&](const json& object_schema, const Place& place) {
        ++objects;
        EXPECT_EQ(object_schema.value("additionalProperties", true), false) << object_schema;
        json object = json::object();
        for (const auto& [key, property_or_ref] : object_schema["properties"].items()) {
          ++properties;
          const json& property = property_or_ref.contains("allOf") ? property_or_ref : Resolve(schema, property_or_ref);
          const bool required = object_schema.contains("required") && object_schema["required"].dump().find('"' + key + '"') != std::string::npos;
          EXPECT_NE(required, property.contains("default")) << key << ": a field is either required or has a default";
          object[key] = property.contains("const")               ? property["const"]
                        : property.contains("default")           ? property["default"]
                        : property.contains("allOf")             ? json::object()
                        : property.value("type", "") == "string" ? json("x")
                                                                 : json({0, 0, 0});
        }
        if (object.value("kind", "") == "mesh") {
          object["vertices"] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
          object["triangles"] = json::parse("[[0,1,2]]");
        }
        const auto known = NormaliseEffect(place(object));
        EXPECT_TRUE(known.ok()) << known.status() << "\n" << place(object);
        object["not_a_field"] = 1;
        EXPECT_THAT(Refusal(place(object)), HasSubstr("not_a_field"));
      });
  EXPECT_GT(objects, 20);  // effect, ground, recall, masks, release rules, fields, objects, …
  EXPECT_GT(properties, 200);
}

/// Reading is what fails (a CHECK) when the simulation forgets a field of the schema: here every field of it is read.
TEST(EffectSchema, TheSimulationReadsEveryField) {
  const json effect = {{"name", "all"},
                       {"description", "d"},
                       {"duration_s", 2},
                       {"duration_min_s", 3},
                       {"output_fps", 30},
                       {"rate_hz", 100},
                       {"gravity_m_s2", 1.5},
                       {"ground", {{"enabled", false}, {"height_m", 0.25}, {"friction", 0.5}, {"restitution", 0.5}}},
                       {"recall", {{"stiffness_s2", 1}, {"damping_ratio", 2}, {"angular_stiffness_s2", 3}, {"angular_damping_ratio", 4}}},
                       {"rupture", {{"acceleration_m_s2", 7}}},
                       {"release",
                        {{{"by", "height"}, {"from", "bottom"}, {"start_s", 1}, {"end_s", 2}, {"share", 0.5}},
                         {{"by", "depth"}, {"from", "inside"}, {"action", "vanish"}, {"speed_m_s", {{{"t", 0}, {"value", 1}}}}},
                         {{"by", "heat"}, {"source", {{"patches", {1, 2}}}}, {"weights", "geometric"}}}},
                       {"fields", {{{"kind", "attractor"}, {"reach_m", 3}}, {{"kind", "wind"}, {"acts_on", "released"}}}},
                       {"distortion", {{{"kind", "twist"}}, {{"kind", "swell"}}, {{"kind", "wave"}}}},
                       {"morph", {{"order", "together"}}},
                       {"bonds", {{"between", "all"}, {"break_stretch", 0.5}}},
                       {"persistence", {{{"erode_from", "top"}}}},
                       {"cells", {{"density_kg_m3", 500}, {"friction", 0.1}, {"restitution", 0.2}, {"shrink_m", 0.001}}},
                       {"objects",
                        {{{"kind", "box"}, {"position_m", {1, 2, 3}}, {"rotation_deg", {10, 20, 30}}, {"origin", "world"}, {"motion", "fixed"}},
                         {{"kind", "sphere"}, {"position_m", {1, 2, 3}}, {"velocity_m_s", {4, 5, 6}}, {"start_s", 0.5}, {"mass_kg", 9}},
                         {{"kind", "pendulum"}, {"pivot_m", {1, 2, 3}}, {"heading_deg", 90}, {"motion", "loose"}}}}};
  const auto read = EffectFromCanonicalJson(*NormaliseEffect(effect));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->duration_s, 2);
  EXPECT_EQ(read->duration_min_s, 3);
  EXPECT_EQ(read->output_fps, 30);
  EXPECT_EQ(read->ground.height_m, 0.25);
  EXPECT_EQ(read->recall.angular_damping_ratio.At(0), 4);
  EXPECT_EQ(read->rupture.acceleration_m_s2->At(0), 7);
  EXPECT_FALSE(std::get<ReleaseByHeight>(read->release[0].by).from_top);
  EXPECT_EQ(read->cells.shrink_m, 0.001);
  ASSERT_EQ(read->objects.size(), 3U);
  EXPECT_EQ(std::get<BoxSettings>(read->objects[0]).placement.motion, Placement::Motion::kFixed);
  EXPECT_EQ(std::get<SphereSettings>(read->objects[1]).placement.velocity_m_s, geometry::Vec3(4, 5, 6));
  EXPECT_EQ(*std::get<PendulumSettings>(read->objects[2]).pivot_m, geometry::Vec3(1, 2, 3));
  EXPECT_FALSE(std::get<PendulumSettings>(read->objects[2]).driven);
}

std::string Text(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(EffectDocs, TellOfEveryFieldAndTheirExamplesAreRight) {
  const std::string text = Text(std::filesystem::path(VOROCAST_SOURCE_DIR) / "docs" / "effects.md");
  const json schema = json::parse(EffectSchemaText());
  VisitObjects(
      schema, schema, [](const json& whole) { return whole; },
      [&](const json& object_schema, const Place&) {
        for (const auto& [key, property] : object_schema["properties"].items()) {
          if (key == "kind" || key == "by") continue;
          EXPECT_THAT(text, HasSubstr("`" + key + "`"));
        }
      });
  int examples = 0;
  for (std::size_t at = text.find("```json"); at != std::string::npos; at = text.find("```json", at + 1)) {
    const auto effect = ParseEffect(text.substr(at + 7, text.find("```", at + 7) - at - 7));
    EXPECT_TRUE(effect.ok()) << effect.status();
    ++examples;
  }
  EXPECT_GT(examples, 3);
}

TEST(EffectSchema, TheStructsDefaultsAreTheSchemas) {
  const Effect defaults;
  const Effect read = *EffectFromCanonicalJson(*NormaliseEffect({{"name", "x"}}));
  EXPECT_EQ(read.rate_hz, defaults.rate_hz);
  EXPECT_EQ(read.gravity_m_s2.At(0), defaults.gravity_m_s2.At(0));
  EXPECT_EQ(read.recall.stiffness_s2.At(0), defaults.recall.stiffness_s2.At(0));
  EXPECT_EQ(read.cells.shrink_m, defaults.cells.shrink_m);
  EXPECT_EQ(read.cells.density_kg_m3, defaults.cells.density_kg_m3);
  EXPECT_EQ(read.ground.surface.friction, defaults.ground.surface.friction);
  EXPECT_EQ(read.cells.surface.restitution, defaults.cells.surface.restitution);
}

}  // namespace
}  // namespace vorocast::simulation
