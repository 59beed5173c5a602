// SPDX-License-Identifier: Apache-2.0
#include "cosim/security/keys.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string_view>

namespace fledge::cosim {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t key_length = 40;
constexpr std::uintmax_t largest_file = 65536;
constexpr std::string_view z85 =
    "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?&<>()[]{}@%$#";

struct Certificate {
    std::string name, nodes;
    KeyPair keys;
};

std::string_view trimmed(std::string_view s)
{
    const auto first = s.find_first_not_of(" \t\r");
    return first == s.npos ? "" : s.substr(first, s.find_last_not_of(" \t\r") - first + 1);
}

Certificate read_certificate(const fs::path &path, bool secret)
{
    const auto fail = [&](const std::string &why) -> void { throw KeyError(path.string() + ": " + why); };
    std::error_code error;
    if (!fs::is_regular_file(path, error)) {
        fail(secret ? "there is no such file; ./fledge keys new makes pairs of keys"
                    : "there is no such file; ask the owner of that pair of keys for it");
    }
    if (fs::file_size(path, error) > largest_file || error) {
        fail("this is no file of a key");
    }
    constexpr auto others = fs::perms::group_all | fs::perms::others_all;
    if (secret && (fs::status(path).permissions() & others) != fs::perms::none) {
        fail("others may read this secret key; chmod 600 keeps it yours, and if they might have, make a new one");
    }
    std::ifstream file(path);
    if (!file) {
        fail("it cannot be read");
    }
    Certificate c;
    int n = 0;
    for (std::string line; std::getline(file, line);) {
        n++;
        const auto text = trimmed(line);
        const auto equals = text.find('=');
        if (text.empty() || text.front() == '#' || equals == text.npos) {
            continue; // a comment, or the name of a section
        }
        const auto name = trimmed(text.substr(0, equals));
        auto value = trimmed(text.substr(equals + 1));
        if (value.size() >= 2 && (value.front() == '"' || value.front() == '\'') && value.back() == value.front()) {
            value = value.substr(1, value.size() - 2);
        }
        if (name == "name") {
            c.name = value;
        } else if (name == "nodes") {
            c.nodes = value;
        } else if (name == "public-key" || name == "secret-key") {
            if (value.size() != key_length || value.find_first_not_of(z85) != value.npos) {
                fail("line " + std::to_string(n) + ": a " + std::string(name) + " is " + std::to_string(key_length) +
                     " characters of Z85, as ./fledge keys writes it");
            }
            (name == "public-key" ? c.keys.open : c.keys.secret) = value;
        }
    }
    if (c.keys.open.empty() || (secret && c.keys.secret.empty())) {
        fail(std::string("it holds no ") + (c.keys.open.empty() ? "public-key" : "secret-key"));
    }
    if (!secret && !c.keys.secret.empty()) {
        fail("a secret key in a file that goes to others; make a new pair with ./fledge keys new");
    }
    if (secret) {
        char open[key_length + 1];
        if (zmq_curve_public(open, c.keys.secret.c_str()) || c.keys.open != open) {
            fail("its public key is not that of its secret key");
        }
    }
    return c;
}

std::vector<fs::path> files_in(const fs::path &folder, std::string_view extension)
{
    std::vector<fs::path> files;
    std::error_code error;
    for (const auto &entry : fs::directory_iterator(folder, error)) {
        if (entry.path().extension() == extension) {
            files.push_back(entry.path());
        }
    }
    std::sort(files.begin(), files.end());
    return files;
}

fs::path secret_of(const fs::path &folder, const std::string &node)
{
    if (fs::path own = folder / (node + ".secret"); node.find('/') == node.npos && fs::exists(own)) {
        return own;
    }
    auto files = files_in(folder, ".secret");
    std::erase_if(files, [](const fs::path &p) { return p.filename() == "controller.secret"; });
    if (files.size() == 1) {
        return files.front();
    }
    if (files.empty()) {
        throw KeyError(folder.string() + " holds no secret key; ./fledge keys new " + node + " makes a pair");
    }
    std::string names;
    for (const fs::path &file : files) {
        names += (names.empty() ? "" : ", ") + file.filename().string();
    }
    throw KeyError(folder.string() + " holds no " + node + ".secret but several others: " + names +
                   "; say which by FLEDGE_KEYS=" + files.front().string());
}

} // namespace

bool AllowedKey::may_speak_as(const std::string &node) const
{
    return std::any_of(nodes.begin(), nodes.end(), [&](const std::string &n) { return n == "*" || n == node; });
}

std::string place_of_keys(const std::string &given)
{
    if (!given.empty()) {
        return given;
    }
    const char *place = std::getenv("FLEDGE_KEYS");
    return place ? place : "";
}

ClientKeys read_client_keys(const fs::path &place, const std::string &node)
{
    std::error_code error;
    if (!fs::exists(place, error)) {
        throw KeyError(place.string() + ": there are no keys; ./fledge keys new " + node + " makes a pair");
    }
    const fs::path secret = fs::is_directory(place) ? secret_of(place, node) : place;
    ClientKeys keys;
    keys.own = read_certificate(secret, true).keys;
    keys.controller = read_certificate(secret.parent_path() / "controller.public", false).keys.open;
    return keys;
}

KeyPair read_controller_keys(const fs::path &folder)
{
    return read_certificate(folder / "controller.secret", true).keys;
}

std::vector<AllowedKey> read_allowed_keys(const fs::path &folder)
{
    std::vector<AllowedKey> allowed;
    for (const fs::path &path : files_in(folder / "allowed", ".public")) {
        const Certificate c = read_certificate(path, false);
        AllowedKey key{path.stem().string(), c.keys.open, {}};
        std::istringstream words(c.nodes);
        for (std::string word; words >> word;) {
            key.nodes.push_back(word);
        }
        if (key.nodes.empty()) {
            throw KeyError(path.string() + R"(: it does not say for which nodes: nodes = "world flight")");
        }
        allowed.push_back(std::move(key));
    }
    return allowed;
}

void use_keys(zmq::socket_t &socket, const ClientKeys &keys)
{
    socket.set(zmq::sockopt::curve_publickey, keys.own.open);
    socket.set(zmq::sockopt::curve_secretkey, keys.own.secret);
    socket.set(zmq::sockopt::curve_serverkey, keys.controller);
}

} // namespace fledge::cosim
