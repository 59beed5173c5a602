// SPDX-License-Identifier: Apache-2.0
#include "ground/packets/history.h"

#include <cmath>
#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>

namespace fledge::ground {

namespace fs = std::filesystem;

namespace {

constexpr std::uint32_t most_sought = 10'000; // packets before a query in which the value of an input is sought

std::string value_of(const std::map<std::string, std::string> &pairs, const std::string &key)
{
    const auto at = pairs.find(key);
    return at != pairs.end() ? at->second : "";
}

std::string metadata(const PacketFile &file, const std::string &name, const std::string &key)
{
    for (const auto &[about, pairs] : file.metadata) {
        if (about == name && pairs.contains(key)) {
            return value_of(pairs, key);
        }
    }
    return "";
}

std::int64_t whole(const std::string &text)
{
    return std::strtoll(text.c_str(), nullptr, 10);
}

std::uint32_t session_of(const PacketFile &file)
{
    return static_cast<std::uint32_t>(whole(metadata(file, "archive", "session")));
}

/// The session that a program writes now; 0: there is none.
std::uint32_t being_written(const std::string &folder)
{
    const int fd = open((folder + "/lock").c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    struct flock all {};
    all.l_type = F_RDLCK;
    char text[16] = {};
    const bool locked = fd >= 0 && fcntl(fd, F_OFD_GETLK, &all) == 0 && all.l_type != F_UNLCK;
    const bool has_text = locked && pread(fd, text, sizeof text - 1, 0) > 0;
    if (fd >= 0) {
        ::close(fd);
    }
    return has_text ? static_cast<std::uint32_t>(whole(text)) : 0;
}

} // namespace

History::History(const std::string &folder, std::string craft, const Database &database, const std::string &root)
    : folder_(folder + "/" + craft), craft_(std::move(craft)), db_(database),
      root_(root.empty() ? no_id : database.container(root))
{
}

/// Update the list of the archive's files.
void History::list()
{
    std::map<Key, std::string> listed;
    std::error_code none; // no folder: the archive is empty
    for (const auto &entry : fs::directory_iterator(folder_, none)) {
        const std::string name = entry.path().filename();
        unsigned session = 0;
        long long t = 0;
        int end = 0;
        if (std::sscanf(name.c_str(), "%6u-%lld.mcap%n", &session, &t, &end) != 2 || end == 0) {
            continue;
        }
        // NAME.lost has what NAME.part had when its program was killed; NAME.part is being written anew from it.
        const std::string suffix = name.substr(static_cast<std::size_t>(end));
        const int rank = suffix.empty() ? 3 : suffix == ".lost" ? 2 : suffix == ".part" ? 1 : 0;
        std::string &best = listed[{session, t}];
        if (rank != 0 && (best.empty() || rank == 3 || (rank == 2 && best.ends_with(".part")))) {
            best = entry.path();
        }
    }
    std::erase_if(listed, [](const auto &entry) { return entry.second.empty(); });
    std::erase_if(files_, [&](const auto &entry) {
        const auto at = listed.find(entry.first);
        return at == listed.end() || at->second != entry.second->path;
    });
    names_ = std::move(listed);
}

/// The file with all that was written up to now; nullptr: it cannot be read.
PacketFile *History::opened(const Key &key)
{
    try {
        auto &file = files_[key];
        if (file == nullptr) {
            file = std::make_unique<PacketFile>(names_.at(key));
        } else {
            file->refresh();
        }
        if (file->path.ends_with(".mcap")) { // an unfinished file may be renamed before it is read
            file->close();
        }
        return file.get();
    } catch (const Refusal &refusal) {
        files_.erase(key);
        const std::string why = refusal.what();
        if (fs::exists(names_.at(key)) && // else it was deleted or renamed meanwhile
            std::none_of(unreadable_.begin(), unreadable_.end(), [&](const auto &gap) { return gap.why == why; })) {
            unreadable_.push_back({key.second, key.second, why});
        }
        return nullptr;
    }
}

/// The files to read and the times in each, in the order of time.
std::vector<History::Piece> History::pieces(const Query &query)
{
    std::vector<Piece> all;
    for (int attempt = 0; attempt < 3; attempt++) {
        all.clear();
        list();
        bool again = false;
        std::int64_t until = query.to;
        for (auto at = names_.rbegin(); at != names_.rend();) { // from the newest session on
            const std::uint32_t session = at->first.first;
            const auto end = std::find_if(at, names_.rend(), [&](auto &entry) { return entry.first.first != session; });
            std::int64_t next = std::numeric_limits<std::int64_t>::max(), first = until;
            bool simulated = false;
            for (; at != end; ++at) {
                const std::int64_t name = at->first.second;
                const bool oldest = std::next(at) == end;
                const bool queried = query.session < 0 || query.session == session;
                // The time in a name may be some nanoseconds late: two files of a session have different names.
                const bool apart = name - 1'000'000'000 > until || next < query.from;
                next = name;
                if (!queried || (apart && !(oldest && query.session < 0))) {
                    continue;
                }
                PacketFile *const file = opened(at->first);
                if (file == nullptr) {
                    again = again || !fs::exists(at->second);
                    continue;
                }
                first = file->count != 0 ? file->first : first;
                simulated = oldest && file->first < whole(metadata(*file, "archive", "received")) / 2;
                if (file->count != 0 && file->first <= until && file->last >= query.from) {
                    all.push_back({file, query.from, until});
                } else {
                    file->close();
                }
            }
            if (query.session < 0) {
                until = std::min(until, first - 1);
            }
            if (query.session < 0 && simulated) {
                break;
            }
        }
        if (!again) {
            break;
        }
    }
    std::reverse(all.begin(), all.end());
    return all;
}

std::string History::container_of(const PacketFile &file, std::uint16_t channel) const
{
    const auto at = file.channels.find(channel);
    const std::string &topic = at != file.channels.end() ? at->second.topic : "";
    // "/CRAFT/path"; only "/CRAFT/undecoded" has no further "/"
    const std::size_t slash = topic.size() > 1 ? topic.find('/', 1) : std::string::npos;
    return slash == std::string::npos || topic.find('/', slash + 1) == std::string::npos ? "" : topic.substr(slash);
}

void History::walk(std::vector<Piece> all, const Wanted &wanted, bool backwards, const Visit &visit)
{
    if (backwards) {
        std::reverse(all.begin(), all.end());
    }
    bool going = true;
    for (const Piece &piece : all) {
        PacketFile &file = *piece.file;
        std::map<std::uint16_t, std::string> containers; // of the wanted channels
        for (const auto &[id, channel] : file.channels) {
            if (const std::string container = container_of(file, id); wanted(container)) {
                containers[id] = container;
            }
        }
        for (std::size_t i = 0; i < file.chunks.size() && going; i++) {
            const auto &chunk = file.chunks[backwards ? file.chunks.size() - 1 - i : i];
            if (chunk.first > piece.to || chunk.last < piece.from ||
                std::none_of(chunk.channels.begin(), chunk.channels.end(),
                             [&](std::uint16_t id) { return containers.count(id) != 0; })) {
                continue;
            }
            std::vector<Stored> held;
            going = file.each(chunk, [&](const Stored &stored) {
                const auto at = containers.find(stored.channel);
                if (at == containers.end() || stored.t < piece.from || stored.t > piece.to) {
                    return true;
                }
                if (backwards) {
                    held.push_back(stored);
                    return true;
                }
                return visit(stored, at->second);
            });
            for (; !held.empty() && going; held.pop_back()) {
                going = visit(held.back(), containers[held.back().channel]);
            }
        }
        file.close();
    }
}

/// The parameter with the longest name that is a prefix of this one, and the length of that name.
std::pair<Id, std::size_t> History::parameter(const std::string &name) const
{
    std::size_t longest = 0;
    Id best = no_id;
    bool twice = false;
    const auto consider = [&](const std::string &known, Id id) {
        if (known.size() >= longest && !known.empty() && name.starts_with(known) &&
            (name.size() == known.size() || name[known.size()] == '.' || name[known.size()] == '[')) {
            twice = known.size() == longest && best != id;
            longest = known.size();
            best = id;
        }
    };
    for (const bool by_name : {false, true}) {
        for (Id id = 0; id < db_.parameters.size() && (!by_name || best == no_id || twice); id++) {
            const Parameter &parameter = db_.parameters[id];
            if (by_name) {
                consider(parameter.name, id);
                continue;
            }
            consider(parameter.path, id);
            for (const auto &[space, alias] : parameter.aliases) {
                consider(space == "Fledge" ? alias : "", id);
            }
        }
        if (best != no_id && !twice) {
            break;
        }
    }
    if (best == no_id) {
        throw Refusal("the database has no parameter " + name);
    }
    if (twice) {
        throw Refusal(name + " is the name of several parameters: give the path of one, as " +
                      db_.parameters[best].path);
    }
    return {best, longest};
}

/// Add the steps behind the name of a parameter: ".member[3]".
void History::add_steps(Target &target, const std::string &name, std::size_t at) const
{
    while (at < name.size()) {
        const Type &type = db_.types[target.type];
        const bool element = name[at] == '[';
        const std::size_t end = element ? name.find(']', at) : std::min(name.find_first_of(".[", at + 1), name.size());
        const std::string step = name.substr(at + 1, end == std::string::npos ? end : end - at - 1);
        const bool number = !step.empty() && step.size() < 9 && step.find_first_not_of("0123456789") == step.npos;
        if (element && (end == std::string::npos || !number || type.sort != Type::Sort::array)) {
            throw Refusal(name + ": " + name.substr(0, at) + " has no element [" + step + "]");
        }
        if (element) {
            target.steps.push_back(static_cast<std::uint32_t>(whole(step)));
            target.type = type.element;
            at = end + 1;
            continue;
        }
        const auto member = std::find_if(type.members.begin(), type.members.end(),
                                         [&](const Member &candidate) { return candidate.name == step; });
        if (member == type.members.end()) {
            throw Refusal(name + ": " + name.substr(0, at) + " has no member " + step);
        }
        target.steps.push_back(static_cast<std::uint32_t>(member - type.members.begin()));
        target.type = member->type;
        at = end;
    }
}

History::Target History::target(const std::string &name, bool numbers) const
{
    using Sort = Type::Sort;
    const auto [id, length] = parameter(name);
    Target target{id, db_.parameters[id].type, {}};
    add_steps(target, name, length);
    for (const auto &[sort, noun] :
         {std::pair(Sort::text, "a text"), std::pair(Sort::binary, "bytes"),
          std::pair(Sort::aggregate, "several members"), std::pair(Sort::array, "several elements")}) {
        const bool bytes = sort == Sort::text || sort == Sort::binary;
        if (db_.types[target.type].sort == sort && (numbers || !bytes)) {
            throw Refusal(name + (numbers ? " is no number but " : " is no value but ") + noun);
        }
    }
    return target;
}

namespace {

/// Whether packets of a container may have values of parameters.
bool carries(const Database &db, Id id, const std::set<Id> &parameters, std::vector<signed char> &known)
{
    if (id == no_id) {
        return false;
    }
    if (known[id] >= 0) {
        return known[id] != 0;
    }
    known[id] = 0;
    bool carried = carries(db, db.containers[id].base, parameters, known);
    for (const Entry &entry : db.containers[id].entries) {
        carried = carried || entry.kind == Entry::Kind::indirect ||
                  (entry.kind == Entry::Kind::parameter && parameters.count(entry.id) != 0);
        if (entry.kind == Entry::Kind::container && !carried) {
            carried = carries(db, entry.id, parameters, known);
            std::vector<Id> heirs = db.containers[entry.id].heirs; // any of them may be in its place
            for (std::size_t i = 0; i < heirs.size() && !carried; i++) {
                carried = carries(db, heirs[i], parameters, known);
                const auto &more = db.containers[heirs[i]].heirs;
                heirs.insert(heirs.end(), more.begin(), more.end());
            }
        }
    }
    known[id] = carried ? 1 : 0;
    return carried;
}

/// Collects the parameters on which places, sizes and values depend; restrictions depend on their own packet alone.
struct References {
    const Database &db;
    std::set<Id> parameters{}, types{}, containers{};

    void add(const Reference &reference)
    {
        if (reference.of == Reference::Of::parameter) {
            parameters.insert(reference.parameter);
        }
    }
    void add(const Condition &condition)
    {
        add(condition.left), add(condition.right);
        for (const Condition &part : condition.parts) {
            add(part);
        }
    }
    void add(const Quantity &quantity)
    {
        add(quantity.from);
        for (const auto &[condition, value] : quantity.cases) {
            add(condition);
        }
    }
    void add(const std::vector<Dimension> &all)
    {
        for (const Dimension &dimension : all) {
            add(dimension.first), add(dimension.last);
        }
    }
    void add(const Calibrator &calibrator)
    {
        for (const MathStep &step : calibrator.steps) {
            add(step.value);
        }
    }
    void add_type(Id id)
    {
        if (id == no_id || !types.insert(id).second) {
            return;
        }
        const Type &type = db.types[id];
        add(type.offset_from), add(type.encoding.size), add(type.encoding.calibrator), add(type.dimensions);
        for (const auto &[condition, calibrator] : type.encoding.contexts) {
            add(condition), add(calibrator);
        }
        add_type(type.element);
        for (const Member &member : type.members) {
            add_type(member.type);
        }
    }
    void add_container(Id id)
    {
        if (id == no_id || !containers.insert(id).second) {
            return;
        }
        add_container(db.containers[id].base);
        for (const Entry &entry : db.containers[id].entries) {
            add(entry.offset), add(entry.include), add(entry.count), add(entry.gap), add(entry.selector);
            add(entry.dimensions);
            if (entry.kind == Entry::Kind::parameter) {
                add_type(db.parameters[entry.id].type);
            } else if (entry.kind == Entry::Kind::container) {
                add_container(entry.id);
                for (const Id heir : db.containers[entry.id].heirs) {
                    add_container(heir);
                }
            }
        }
    }
};

} // namespace

std::set<Id> History::carriers(const std::set<Id> &parameters) const
{
    std::vector<signed char> known(db_.containers.size(), -1);
    std::set<Id> containers;
    for (Id id = 0; id < db_.containers.size(); id++) {
        if (carries(db_, id, parameters, known)) {
            containers.insert(id);
        }
    }
    return containers;
}

namespace {

/// Whether these steps lead to this node.
bool leads(const std::vector<std::uint32_t> &steps, const Decoded &packet, std::uint32_t node)
{
    std::size_t left = steps.size();
    for (; left != 0 && node != 0 && packet.nodes[node].place == steps[left - 1]; left--) {
        node = packet.nodes[node].parent;
    }
    return left == 0 && node == 0;
}

void at_most(std::uint64_t n, std::uint64_t most, const char *verb)
{
    if (n > most) {
        throw Refusal("this query would " + std::string(verb) + " more than " + std::to_string(most) +
                      " values: ask for a shorter time, fewer parameters or fewer points");
    }
}

} // namespace

/// The parameters of earlier packets on which the values of a container's packets depend.
std::set<Id> History::references(Id container) const
{
    References all{db_};
    all.add_container(container);
    std::erase_if(all.parameters, [&](Id parameter) {
        std::vector<signed char> known(db_.containers.size(), -1);
        return carries(db_, container, {parameter}, known);
    });
    return all.parameters;
}

/// The containers whose packets have values of the targets or values on which those depend. before: the containers of
/// which packets before the query are needed, and how many.
std::set<Id> History::needed(const std::vector<Target> &targets, const std::vector<Judge> &judges,
                             std::map<Id, std::uint32_t> &before) const
{
    std::set<Id> parameters;
    for (const Target &target : targets) {
        parameters.insert(target.parameter);
    }
    std::set<Id> containers = carriers(parameters);
    for (std::size_t i = 0; i < judges.size(); i++) {
        References conditions{db_};
        for (const Alarm &alarm : db_.types[targets[i].type].alarms) {
            conditions.add(alarm.when);
        }
        for (const Id id : conditions.parameters.empty() ? std::set<Id>() : carriers(conditions.parameters)) {
            before.emplace(id, 1);
            containers.insert(id);
        }
        for (const Id id : judges[i].depth() > 1 ? carriers({targets[i].parameter}) : std::set<Id>()) {
            before[id] = std::max(before[id], judges[i].depth() - 1);
        }
    }
    std::vector<Id> open(containers.begin(), containers.end());
    while (!open.empty()) {
        const std::set<Id> referred = references(open.back());
        open.pop_back();
        for (const Id id : referred.empty() ? std::set<Id>() : carriers(referred)) {
            before.emplace(id, 1);
            if (containers.insert(id).second) {
                open.push_back(id);
            }
        }
    }
    return containers;
}

/// The last packets before a query, in the order of time: so many of each container, and the last that has a value of
/// each input. A file that was written with another database has other containers, so its packets are decoded.
std::vector<History::Earlier> History::earlier(const std::map<Id, std::uint32_t> &before,
                                               const std::vector<Target> &inputs, const Query &query)
{
    std::vector<Earlier> last;
    const std::string hash = hash_text(db_);
    Decoder decoder(db_);
    const auto back = [&](const std::set<std::string> &paths, const std::function<bool(const Stored &)> &needs_more) {
        std::vector<Piece> all = pieces({0, query.from - 1, query.session});
        std::uint32_t left = most_sought;
        for (bool more = true; !all.empty() && more; all.pop_back()) {
            const bool same = metadata(*all.back().file, "archive", "database") == hash;
            walk(
                {all.back()}, [&](const std::string &container) { return !same || paths.contains(container); }, true,
                [&, session = session_of(*all.back().file)](const Stored &stored, const std::string &) {
                    if (!same) {
                        const Decoded &done = decoder.decode(stored.packet, root_);
                        if (done.container == no_id || !paths.contains(db_.containers[done.container].path)) {
                            return more = --left != 0;
                        }
                    }
                    last.emplace_back(stored.t, stored.received, session,
                                      std::vector(stored.packet.begin(), stored.packet.end()));
                    return more = needs_more(stored);
                });
        }
    };
    for (const auto &[id, n] : before) {
        back({db_.containers[id].path}, [left = n](const Stored &) mutable { return --left != 0; });
    }
    for (const Target &input : inputs) {
        std::set<std::string> paths;
        for (const Id id : carriers({input.parameter})) {
            paths.insert(db_.containers[id].path);
        }
        back(paths, [&, left = most_sought](const Stored &stored) mutable { // it may lie behind a condition
            const Decoded &done = decoder.decode(stored.packet, root_);
            bool found = false;
            for (const Field &field : done.reason.empty() ? done.fields : std::span<const Field>()) {
                found = found || (field.parameter == input.parameter && leads(input.steps, done, field.node));
            }
            return !found && --left != 0;
        });
    }
    std::reverse(last.begin(), last.end()); // packets of one time keep the order of the archive
    std::stable_sort(last.begin(), last.end(), [](const Earlier &a, const Earlier &b) {
        return std::pair(std::get<0>(a), std::get<1>(a)) < std::pair(std::get<0>(b), std::get<1>(b));
    });
    return last;
}

/// The times of the first and last packet. Throws Refusal if the query would decode too many packets.
std::pair<std::int64_t, std::int64_t> History::extent(const std::vector<Piece> &all, const Query &query,
                                                      const std::function<Wanted(const PacketFile &)> &wanted_of) const
{
    double n = 0, span = 0;
    std::int64_t begin = query.to, end = query.from;
    for (const Piece &piece : all) {
        const PacketFile &file = *piece.file;
        const Wanted wanted = wanted_of(file);
        std::uint64_t of_file = 0;
        for (const auto &[id, channel] : file.channels) {
            of_file += wanted(container_of(file, id)) ? channel.count : 0;
        }
        const std::int64_t from = std::max(piece.from, file.first), to = std::min(piece.to, file.last);
        begin = std::min(begin, from);
        end = std::max(end, to);
        const double length = static_cast<double>(file.last) - static_cast<double>(file.first);
        const double part = static_cast<double>(to) - static_cast<double>(from);
        n += static_cast<double>(of_file) * (length > 0 ? part / length : 1);
        span += part;
    }
    if (n > static_cast<double>(most_decoded)) {
        char text[400];
        std::snprintf(
            text, sizeof text,
            "this query would decode %.0f packets, of %.3g days; the most is %.0f: ask for a shorter time, as "
            "%.2g days, or for parameters of rarer packets; long times are for the database of values",
            n, span / 86400e9, static_cast<double>(most_decoded),
            span / 86400e9 * static_cast<double>(most_decoded) / n);
        throw Refusal(text);
    }
    return {begin, end};
}

/// Calls `value` for the values before the query on which others depend, then `range` once with the times of the first
/// and last packet, then `value` for each value of the targets and `packet` after the last of each packet. held: the
/// last value of each target before the query counts, too.
void History::decode(const std::vector<Target> &targets, const std::vector<Judge> &judges, bool held,
                     const Query &query, const Range &range, const Value &value,
                     const std::function<void(const Stored &)> &packet)
{
    std::map<Id, std::uint32_t> before;
    std::set<std::string> paths;
    for (const Id id : needed(targets, judges, before)) {
        paths.insert(db_.containers[id].path);
    }
    const std::string hash = hash_text(db_);
    const auto wanted_of = [&](const PacketFile &file) -> Wanted {
        // If the file was written with another database, any packet may have the parameters now.
        const bool same = metadata(file, "archive", "database") == hash;
        return [&paths, same](const std::string &container) { return !same || paths.count(container) != 0; };
    };
    Decoder decoder(db_);
    std::vector<std::vector<std::size_t>> targets_of(db_.parameters.size());
    for (std::size_t k = 0; k < targets.size(); k++) {
        targets_of[targets[k].parameter].push_back(k);
    }
    std::uint64_t values = 0;
    const auto process = [&](const Stored &stored, std::uint32_t session, bool earlier) {
        const Decoded &done = decoder.decode(stored.packet, root_);
        bool any = false;
        for (std::size_t i = 0; done.reason.empty() && i < done.fields.size(); i++) {
            for (const std::size_t k : targets_of[done.fields[i].parameter]) {
                if (leads(targets[k].steps, done, done.fields[i].node)) {
                    at_most(++values, most_seen, "read");
                    value({decoder, done, i, k, stored.t, stored.received, session, earlier});
                    any = true;
                }
            }
        }
        if (any && !earlier) {
            packet(stored);
        }
    };
    std::vector<Piece> all = pieces(query);
    if ((!before.empty() || held) && !all.empty() && query.from > 0) {
        for (const auto &[t, received, session, bytes] :
             earlier(before, held ? targets : std::vector<Target>(), query)) {
            process({t, received, 0, bytes}, session, true);
        }
        all = pieces(query); // files may have been renamed meanwhile
    }
    const auto [begin, end] = extent(all, query, wanted_of);
    range(begin, end);
    for (const Piece &piece : all) {
        walk({piece}, wanted_of(*piece.file), false,
             [&, session = session_of(*piece.file)](const Stored &stored, const std::string &) {
                 process(stored, session, false);
                 return true;
             });
    }
}

std::vector<History::Series> History::series(const std::vector<std::string> &names, Query query, std::size_t points,
                                             const Settings *limits, bool exact)
{
    const std::lock_guard lock(mutex_);
    std::vector<Target> targets;
    std::vector<Judge> judges;
    std::vector<Series> result(names.size());
    for (std::size_t i = 0; i < names.size(); i++) {
        targets.push_back(target(names[i], !exact));
        result[i].type = targets[i].type;
        if (limits != nullptr) {
            const auto set = limits->find(names[i]);
            judges.emplace_back(db_.types[targets[i].type],
                                set != limits->end() ? set->second : std::vector<Judge::Setting>());
        }
    }
    std::int64_t from = 0, width = 0; // 0: each value
    std::vector<std::int64_t> bucket(names.size(), -1);
    std::uint64_t n = 0;
    decode(
        targets, judges, false, query,
        [&](std::int64_t begin, std::int64_t end) {
            from = begin;
            width = points != 0 && end > begin ? (end - begin) / static_cast<std::int64_t>(points) + 1 : 0;
        },
        [&](const Sample &sample) {
            const Decoded &packet = sample.packet;
            const Field &field = packet.fields[sample.field];
            const std::uint64_t word = packet.values[sample.field], raw = packet.raw[sample.field];
            const Status status = packet.status[sample.field];
            const bool bytes = field.value == Kind::text || field.value == Kind::binary;
            const std::string_view text = bytes ? packet.text(word) : std::string_view();
            std::uint8_t concern = 0;
            if (!judges.empty()) {
                concern = static_cast<std::uint8_t>(
                    judges[sample.target].take(sample.decoder, {field.value, field.raw, status, raw, word, text},
                                               sample.received, sample.session));
            }
            if (sample.before) {
                return;
            }
            const double value = number(field.value, word, field.raw, raw, status);
            Series &series = result[sample.target];
            const std::int64_t place = width != 0 ? (sample.t - from) / width : 0;
            if (width != 0 && place == bucket[sample.target]) {
                series.t.back() = sample.t;
                series.value.back() = value;
                series.low.back() = std::fmin(series.low.back(), value);
                series.high.back() = std::fmax(series.high.back(), value);
                series.concern.back() = concern;
                series.worst.back() = std::max(series.worst.back(), concern);
            } else {
                at_most(n += 1 + (exact ? text.size() / 64 : 0), most_values, "give");
                bucket[sample.target] = place;
                series.t.push_back(sample.t);
                series.value.push_back(value);
                series.low.push_back(value);
                series.high.push_back(value);
                series.concern.push_back(concern);
                series.worst.push_back(concern);
            }
            if (exact) {
                series.exact.resize(series.t.size());
                series.exact.back() = {word, raw, status, std::string(text)};
            }
        },
        [](const Stored &) {});
    return result;
}

History::Rows History::rows(const std::vector<std::string> &inputs, Query query)
{
    const std::lock_guard lock(mutex_);
    std::vector<Target> targets;
    for (const std::string &name : inputs) {
        targets.push_back(target(name, true));
    }
    Rows result;
    std::vector<double> newest(inputs.size());
    std::vector<bool> has_value(inputs.size());
    decode(
        targets, {}, true, query, [](std::int64_t, std::int64_t) {},
        [&](const Sample &sample) {
            const Decoded &packet = sample.packet;
            const Field &field = packet.fields[sample.field];
            newest[sample.target] = number(field.value, packet.values[sample.field], field.raw,
                                           packet.raw[sample.field], packet.status[sample.field]);
            has_value[sample.target] = true;
        },
        [&](const Stored &stored) {
            if (std::find(has_value.begin(), has_value.end(), false) == has_value.end()) {
                at_most((result.received.size() + 1) * (1 + inputs.size()), most_seen / 4, "read");
                result.values.push_back(std::bit_cast<double>(stored.t));
                result.values.insert(result.values.end(), newest.begin(), newest.end());
                result.received.push_back(stored.received);
            }
        });
    return result;
}

std::vector<History::Packet> History::packets(Query query, const std::string &container, std::size_t limit,
                                              bool backwards, std::uint64_t most_bytes)
{
    const std::lock_guard lock(mutex_);
    const bool undecoded = container == "undecoded";
    const auto wanted = [&](const std::string &path) {
        return container.empty() || (undecoded ? path.empty() : path == container || path.ends_with("/" + container));
    };
    std::vector<Packet> result;
    std::uint64_t bytes = 0;
    if (limit != 0) {
        walk(pieces(query), wanted, backwards, [&](const Stored &stored, const std::string &path) {
            result.push_back({stored.t, stored.received, path, {stored.packet.begin(), stored.packet.end()}});
            bytes += stored.packet.size();
            return result.size() < limit && bytes < most_bytes;
        });
    }
    return result;
}

std::vector<History::Packet> History::next(Query query, std::size_t skip, std::size_t limit, std::int64_t span)
{
    const std::lock_guard lock(mutex_);
    std::vector<Packet> result;
    walk(
        pieces(query), [](const std::string &) { return true; }, false,
        [&](const Stored &stored, const std::string &path) {
            if (skip != 0) {
                skip--;
                return true;
            }
            if (!result.empty() && stored.t - result.front().t > span) {
                return false;
            }
            result.push_back({stored.t, stored.received, path, {stored.packet.begin(), stored.packet.end()}});
            return result.size() < limit;
        });
    return result;
}

std::vector<History::Session> History::sessions()
{
    const std::lock_guard lock(mutex_);
    list();
    unreadable_.clear();
    const std::uint32_t written = being_written(folder_);
    std::vector<Session> result;
    for (const auto &[key, name] : std::map(names_)) {
        PacketFile *const file = opened(key);
        if (file == nullptr || file->count == 0) {
            continue;
        }
        if (result.empty() || result.back().number != key.first) {
            const bool follows = !result.empty() && file->first > result.back().last;
            const Session before = follows ? result.back() : Session();
            result.push_back({key.first, file->first, file->last, 0, "", {}});
            if (follows) {
                result.back().gaps.push_back(
                    {before.last, file->first, "restart; the session before: " + before.ended});
            }
        }
        Session &session = result.back();
        session.last = file->last;
        session.packets += file->count;
        const std::string why = metadata(*file, "ended", "why");
        session.ended = !why.empty() ? why : key.first == written ? "" : "killed";
        for (const auto &[about, pairs] : file->metadata) {
            if (about == "gap") {
                const std::string n = value_of(pairs, "packets");
                session.gaps.push_back({whole(value_of(pairs, "from")), whole(value_of(pairs, "to")),
                                        value_of(pairs, "why") + (n == "0" ? "" : "; " + n + " packets")});
            }
        }
        session.gaps.insert(session.gaps.end(), file->missing.begin(), file->missing.end());
        file->close();
    }
    if (!result.empty()) {
        auto &gaps = result.back().gaps;
        gaps.insert(gaps.end(), unreadable_.begin(), unreadable_.end());
    }
    return result;
}

} // namespace fledge::ground
