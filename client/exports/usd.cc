#include "client/exports/usd.h"

#include <fmt/format.h>

#include <cctype>
#include <filesystem>
#include <iterator>
#include <set>

#include "client/files/text_file.h"
#include "common/mesh_faces.h"

namespace romap::exports {
namespace {

// Names of prims are identifiers.
std::string PrimName(const std::string& name, std::set<std::string>* used) {
  std::string prim = "o_";
  for (const char c : name) prim += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  while (!used->insert(prim).second) prim += "_";
  return prim;
}

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + "\"";
}

template <class Values, class Print>
std::string List(const Values& values, const Print& print) {
  std::string text = "[";
  for (const auto& value : values) {
    if (text.size() > 1) text += ", ";
    text += print(value);
  }
  return text + "]";
}

std::string Vector(const Eigen::Vector3f& v) { return fmt::format("({:.7g}, {:.7g}, {:.7g})", v.x(), v.y(), v.z()); }

// USD multiplies row vectors from the left.
std::string MatrixText(const Sim3<World, Object>& S) {
  const Eigen::Matrix3d sR = S.scale() * S.rotation().toRotationMatrix();
  const Eigen::Vector3d& t = S.translation();
  std::string text = "(";
  for (int column = 0; column < 3; ++column) {
    text += fmt::format("({}, {}, {}, 0), ", sR(0, column), sR(1, column), sR(2, column));
  }
  return text + fmt::format("({}, {}, {}, 1))", t.x(), t.y(), t.z());
}

std::string MaterialText(const std::string& prim, const std::string& file) {
  return fmt::format(R"(
        def Material "Surface"
        {{
            token outputs:surface.connect = </Map/{0}/Surface/Shader.outputs:surface>
            def Shader "Shader"
            {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </Map/{0}/Surface/Texture.outputs:rgb>
                float inputs:roughness = 1
                token outputs:surface
            }}
            def Shader "Texture"
            {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @{1}@
                float2 inputs:st.connect = </Map/{0}/Surface/Coordinates.outputs:result>
                float3 outputs:rgb
            }}
            def Shader "Coordinates"
            {{
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
            }}
        }}
)",
                     prim, file);
}

std::string MeshText(const UsdObject& object, const std::string& prim, const std::string& texture_file) {
  const Mesh& mesh = *object.mesh;
  const auto out = [](const std::string& line) { return "        " + line + "\n"; };
  std::string text = fmt::format(
      "    def Mesh \"{}\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n"
      "        customData = {{\n            string className = {}\n        }}\n    )\n    {{\n",
      prim, Quoted(object.class_name));
  text += out("matrix4d xformOp:transform = " + MatrixText(object.S_world_mesh));
  text += out("uniform token[] xformOpOrder = [\"xformOp:transform\"]");
  text += out("uniform token subdivisionScheme = \"none\"");
  text += out("int[] faceVertexCounts = " +
              List(mesh.triangles, [](const auto& /*triangle*/) { return std::string("3"); }));
  text += out("int[] faceVertexIndices = " + List(mesh.triangles, [](const auto& triangle) {
                return fmt::format("{}, {}, {}", triangle[0], triangle[1], triangle[2]);
              }));
  text += out("point3f[] points = " + List(mesh.vertices, Vector));
  if (!mesh.normals.empty()) {
    text += out("normal3f[] normals = " + List(mesh.normals, Vector) +
                " (\n            interpolation = \"vertex\"\n        )");
  }
  if (!texture_file.empty()) {
    // USD counts v upwards.
    text += out(
        "texCoord2f[] primvars:st = " +
        List(mesh.uv, [](const Eigen::Vector2f& uv) { return fmt::format("({:.7g}, {:.7g})", uv.x(), 1 - uv.y()); }) +
        " (\n            interpolation = \"vertex\"\n        )");
    text += out(fmt::format("rel material:binding = </Map/{}/Surface>", prim));
    text += MaterialText(prim, texture_file);
  } else if (!mesh.colors.empty()) {
    text +=
        out("color3f[] primvars:displayColor = " +
            List(mesh.colors,
                 [](const Rgb8& color) {
                   return fmt::format("({:.4f}, {:.4f}, {:.4f})", color[0] / 255.0, color[1] / 255.0, color[2] / 255.0);
                 }) +
            " (\n            interpolation = \"vertex\"\n        )");
  }
  return text + "    }\n";
}

}  // namespace

absl::Status WriteUsd(const std::string& path, const std::vector<UsdObject>& objects) {
  std::string text =
      "#usda 1.0\n(\n    defaultPrim = \"Map\"\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n\ndef Xform \"Map\"\n{\n";
  std::set<std::string> used;
  for (const UsdObject& object : objects) {
    if (object.mesh->triangles.empty()) continue;
    ROMAP_RETURN_IF_ERROR(ValidateMesh(*object.mesh, object.name));
    const std::string prim = PrimName(object.name, &used);
    std::string texture_file;
    if (object.texture != nullptr && !object.texture->image.empty() && !object.mesh->uv.empty()) {
      texture_file = prim + (object.texture->media_type == "image/png" ? ".png" : ".jpg");
      const std::filesystem::path beside = std::filesystem::path(path).parent_path() / texture_file;
      ROMAP_RETURN_IF_ERROR(files::WriteFile(beside.string(), object.texture->image));
    }
    text += MeshText(object, prim, texture_file);
  }
  return files::WriteFile(path, text + "}\n");
}

}  // namespace romap::exports
