// SPDX-License-Identifier: Apache-2.0
// Python objects that are C structs. Every struct in the tables becomes a Python type: a module or
// model owns an instance, a message or plain struct is a view into one. An attribute is read and
// written straight on the memory by a getset whose closure is the field; arrays are numpy views.
// Written with the C API, because this is the path that a user's loop takes.
//
// Lifetimes: a view holds its owner, an array holds the object it was read from, and an instance's
// memory never moves. No object here can be part of a cycle, so none takes part in garbage collection.
//
// Example:
//
//     PyObject *module_of(const FledgeStruct &table)
//     {
//         return core::wrap(std::make_shared<sim::Instance>(table)); // null with an exception set
//     }
#pragma once

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include "sim/instance.h"

#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace fledge::core {

struct Type;

/// A field as an attribute.
struct Member {
    const FledgeField *field;
    const Type *owner;               ///< the struct that it is a field of
    std::size_t index;               ///< in the struct's table
    const Member *count = nullptr;   ///< the field that says how many rows count
    const Type *sub = nullptr;       ///< of a struct
    PyObject *name = nullptr;        ///< interned, for keywords
    PyObject *enumeration = nullptr; ///< of an enum; made at the first use
    bool checked = false;            ///< a parameter: the header's rule holds at each assignment
    std::string doc;
};

/// A struct, and the Python type made from it. Lives as long as the process.
struct Type {
    const FledgeStruct *table;
    const sim::ModelType *model = nullptr;
    bool prototype = false; ///< its behaviour is a class in Python (core/prototype.h)
    PyTypeObject *python = nullptr;
    std::deque<Member> members; ///< spares left out
    std::vector<PyGetSetDef> getset;

    const Member *find(std::string_view name) const;
};

/// The beginning of all objects.
struct Object {
    PyObject_HEAD std::byte *memory;
    const Type *type;
    PyObject *weak;
};

/// A message or plain struct: inside its owner, or by itself with memory of its own.
struct View : Object {
    PyObject *owner;      ///< null: by itself
    const Member *member; ///< as which the owner holds it
    std::size_t index;    ///< its place in an array of structs
};

/// A module or model.
struct Root : Object {
    std::shared_ptr<sim::Instance> instance;
    PyObject *parts;   ///< a tuple of the models attached to this one, or null
    PyObject *context; ///< a weak reference to the process it was given to, or null
    bool runs;         ///< a function of the user's runs with it: it writes outputs
    const Tick *tick;  ///< of its update, while that runs; else null
};

inline Object *as_object(PyObject *p)
{
    return reinterpret_cast<Object *>(p);
}
inline View *as_view(PyObject *p)
{
    return static_cast<View *>(as_object(p));
}
inline Root *as_root(PyObject *p)
{
    return static_cast<Root *>(as_object(p));
}

bool is_object(PyObject *p); ///< any of ours
bool is_root(PyObject *p);
bool is_view(PyObject *p);

/// "flight.control.error", or the type's name for what has no name yet.
std::string path_of(PyObject *object);

/// The module or model that a view is a part of; itself for a root; null for a view by itself.
PyObject *root_of(PyObject *object);

/// Whether an assignment may change a field, or why not.
enum class Writable {
    yes,
    of_another, ///< of another module than the one whose function in Python runs
    given,      ///< in a parameter or an input of that module: no reset would undo it
    wired,      ///< in an input that a wire or a feed writes before each update
    too_early,  ///< in the memory of a module before its run, which begins with a reset
    elsewhere,  ///< in a module that a computer outside flies: nothing reads it
    written,    ///< in an output of a module that has a process and writes it: the assignment would have no effect
};
Writable writable(PyObject *object, const Member &member);

/// A new object for an instance. A new reference, or null with an exception set.
PyObject *wrap(std::shared_ptr<sim::Instance> instance);

/// Set a SetupError about a field: what the function of that name in hooks.py says of its module and its path.
void refuse_field(PyObject *object, const Member &member, const char *function);

/// The function of that name in fledge/objects/hooks.py, which is imported at the first call. Borrowed;
/// null with an exception set.
PyObject *hook(const char *name);

/// Make the base types and add them to the extension. False with an exception set on failure.
bool add_base_types(PyObject *module);

/// The Python type of a struct, made at the first call. A struct of the same name and content in
/// another library is the same type. Null with an exception set on failure.
const Type *type_of(const FledgeStruct &table, const char *library, const sim::ModelType *model = nullptr);

/// A type that no other struct shares, whatever its content: of a prototype. Null with an exception set on failure.
const Type *make_prototype_type(const FledgeStruct &table);

/// A new object for a new instance, its fields set from keywords. A new reference, or null with an exception set.
PyObject *new_object(const Type &type, std::shared_ptr<sim::Instance> instance, PyObject *keywords);

/// The type made from this struct earlier, or null.
const Type *find_type(const FledgeStruct &table);

/// The type behind a Python type, or null.
const Type *find_type(PyTypeObject *python);

} // namespace fledge::core
