// SPDX-License-Identifier: Apache-2.0
#include "ground/database/xtce.h"

#include "ground/database/xtce/readers.h"

#include <fstream>

namespace fledge::ground {

namespace {

constexpr int most_rounds = 100;

void fill_parameters(Database &database, xtce::Declarations &declared)
{
    declared.each(database.parameters, declared.parameters, [&](Id i) {
        const xtce::Node node = declared.parameters[i].node;
        Parameter &parameter = database.parameters[i];
        if (declared.left_out(declared.types[parameter.type])) {
            xtce::refuse_reference(database.types[parameter.type].path);
        }
        parameter.initial = xtce::initial(node);
        declared.parts(node, parameter.path, [&](xtce::Node child) { // without one of these it is the same parameter
            if (xtce::tag(child) == "ParameterProperties") {
                parameter.source = child.attribute("dataSource").as_string("telemetered");
            } else if (!xtce::is_common(child)) {
                xtce::refuse_element(child);
            }
        });
    });
}

void fill(Database &database, xtce::Declarations &declared)
{
    xtce::ValueReader values(database, declared);
    const xtce::Context context{database, declared, values};
    xtce::TypeReader types(context);
    xtce::ContainerReader containers(context, types);
    xtce::CommandReader commands(context);
    types.read_structures();
    declared.each(database.parameters, declared.parameters, [&](Id i) {
        database.parameters[i].type = declared.type(declared.parameters[i].node, "parameterTypeRef", false);
    });
    types.fill();
    types.find_epochs();
    fill_parameters(database, declared);
    containers.fill();
    commands.fill();
    containers.refuse_loops();
    commands.refuse_loops();
    containers.refuse_doubtful_ends();
    values.note_constants();
    for (Id i = 0; i < database.containers.size(); i++) {
        if (database.containers[i].base != no_id) {
            database.containers[database.containers[i].base].heirs.push_back(i);
        }
    }
}

/// Refuses all faults of the files at once; lenient: leaves out the items with faults, and in further rounds the items
/// that refer to them.
class Reader {
public:
    void add(std::string text, const std::string &name, const std::string &under)
    {
        try {
            documents_.add(std::move(text), name, under);
        } catch (const xtce::Fault &fault) {
            faults_.add(fault, {}, name);
        }
    }

    Database finish(bool lenient)
    {
        faults_.refuse();
        std::vector<std::string> left_out;
        std::size_t searched = 0;
        for (int round = 0;; round++) {
            Database database;
            database.files = documents_.files();
            database.hash = documents_.hash();
            xtce::Declarations declared(database, documents_, faults_, searched);
            declared.declare();
            fill(database, declared);
            if (faults_.empty()) {
                database.left_out = std::move(left_out);
                return database;
            }
            if (!lenient) {
                faults_.refuse();
            }
            if (round == most_rounds) {
                throw Refusal(faults_.first() + "; more than " + std::to_string(most_rounds) +
                              " things depend on one another and on a fault");
            }
            for (std::string &text : faults_.take()) {
                left_out.push_back(std::move(text));
            }
        }
    }

private:
    xtce::Documents documents_;
    xtce::Faults faults_{documents_};
};

} // namespace

Database read_xtce(const std::vector<XtceFile> &files, bool lenient)
{
    Reader reader;
    for (const XtceFile &file : files) {
        std::ifstream in(file.name, std::ios::binary);
        std::string text;
        for (std::size_t n = 0; in && n <= xtce::most_text; n = text.size()) { // in parts: a device may have no end
            text.resize(n + (1 << 20));
            in.read(text.data() + n, 1 << 20);
            text.resize(n + static_cast<std::size_t>(in.gcount()));
        }
        if (text.empty() || in.bad()) {
            throw Refusal(file.name + ": cannot be read, or is empty");
        }
        reader.add(std::move(text), file.name, file.under == "/" ? "" : file.under);
    }
    return reader.finish(lenient);
}

Database read_xtce_text(std::string text, const std::string &name, bool lenient)
{
    Reader reader;
    reader.add(std::move(text), name, "");
    return reader.finish(lenient);
}

} // namespace fledge::ground
