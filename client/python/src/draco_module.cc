// The Python module romap._draco: decodes meshes with the decoder of the C++ client.
//
// decode(data: bytes) -> (vertices, triangles, normals, colors, uv, confidence), each a bytearray without padding:
// float32 x 3, uint32 x 3, float32 x 3, uint8 x 3, float32 x 2, float32. The last four are empty if the mesh has none.
// ValueError: not a mesh of romap.

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x03090000
#include <Python.h>

#include <string>

#include "common/mesh_codec.h"
#include "common/status.h"

namespace romap::python {
namespace {

template <class Value>
PyObject* ToByteArray(const std::vector<Value>& values) {
  return PyByteArray_FromStringAndSize(reinterpret_cast<const char*>(values.data()),
                                       static_cast<Py_ssize_t>(values.size() * sizeof(Value)));
}

PyObject* Decode(PyObject* /*module*/, PyObject* argument) {
  char* data = nullptr;
  Py_ssize_t size = 0;
  if (PyBytes_AsStringAndSize(argument, &data, &size) != 0) return nullptr;
  const std::string bytes(data, static_cast<size_t>(size));
  absl::StatusOr<Mesh> mesh;
  Py_BEGIN_ALLOW_THREADS;
  mesh = DecodeDraco(bytes);
  Py_END_ALLOW_THREADS;
  if (!mesh.ok()) {
    PyErr_SetString(PyExc_ValueError, Message(mesh.status()).c_str());
    return nullptr;
  }
  return Py_BuildValue("(NNNNNN)", ToByteArray(mesh->vertices), ToByteArray(mesh->triangles),
                       ToByteArray(mesh->normals), ToByteArray(mesh->colors), ToByteArray(mesh->uv),
                       ToByteArray(mesh->confidence));
}

PyMethodDef methods[] = {{"decode", Decode, METH_O, "Decodes a Draco mesh; see draco_module.cc."},
                         {nullptr, nullptr, 0, nullptr}};
PyModuleDef module = {PyModuleDef_HEAD_INIT, "_draco", nullptr, 0, methods, nullptr, nullptr, nullptr, nullptr};

}  // namespace
}  // namespace romap::python

PyMODINIT_FUNC PyInit__draco() { return PyModule_Create(&romap::python::module); }
