// SPDX-License-Identifier: Apache-2.0
#include "emulator/testing/qemu.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace fledge::emulator::testing {
namespace {

namespace fs = std::filesystem;

class Folder {
public:
    Folder()
    {
        std::string name = fs::temp_directory_path() / "fledge_qemu_XXXXXX";
        if (mkdtemp(name.data()) == nullptr)
            throw std::runtime_error("cannot make a folder like " + name);
        path = name;
    }
    ~Folder()
    {
        std::error_code ignored;
        fs::remove_all(path, ignored);
    }
    fs::path path;
};

void put(std::vector<std::uint8_t> &bytes, std::uint32_t value, int size)
{
    while (size-- > 0)
        bytes.push_back(static_cast<std::uint8_t>(value >> (8 * size)));
}

// The ELF that QEMU starts: one segment with the trap table; the rest is in memory already.
std::vector<std::uint8_t> elf(const Stream &stream)
{
    constexpr std::uint32_t headers = 52 + 32, size = 4096;
    std::vector<std::uint8_t> b{0x7F, 'E', 'L', 'F', 1, 2, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    put(b, 2, 2); // executable
    put(b, 2, 2); // SPARC
    for (const std::uint32_t word : {1u, stream.entry, 52u, 0u, 0u})
        put(b, word, 4);
    for (const std::uint32_t half : {52u, 32u, 1u, 40u, 0u, 0u})
        put(b, half, 2);
    for (const std::uint32_t word : {1u, headers, ram_base, ram_base, size, size, 7u, 4u})
        put(b, word, 4);
    b.insert(b.end(), stream.image.begin(), stream.image.begin() + size);
    return b;
}

void write(const fs::path &path, const std::vector<std::uint8_t> &bytes)
{
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char *>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

} // namespace

std::string without_qemu()
{
    std::FILE *pipe = popen("qemu-system-sparc --version 2> /dev/null", "r");
    int major = 0;
    const bool found = pipe != nullptr && std::fscanf(pipe, "QEMU emulator version %d", &major) == 1;
    if (pipe != nullptr)
        pclose(pipe);
    if (!found)
        return "not installed: qemu-system-sparc";
    return major > 7 ? "QEMU " + std::to_string(major) + " has another floating-point unit than QEMU 7" : "";
}

std::vector<std::uint8_t> run_in_qemu(const Stream &stream)
{
    const Folder folder;
    write(folder.path / "ram", stream.image);
    write(folder.path / "elf", elf(stream));
    const std::string size = std::to_string(stream.size >> 20) + "M", f = folder.path;
    const std::string command = "timeout 120 qemu-system-sparc -M leon3_generic,memory-backend=ram -m " + size +
                                " -object memory-backend-file,id=ram,share=on,mem-path=" + f + "/ram,size=" + size +
                                " -display none -monitor none -serial none -no-reboot -kernel " + f + "/elf >" + f +
                                "/log 2>&1";
    const int status = std::system(command.c_str());
    if (status != 0) {
        std::ifstream log(folder.path / "log");
        throw std::runtime_error("qemu-system-sparc ended with status " + std::to_string(status) + ": " +
                                 std::string(std::istreambuf_iterator<char>(log), {}));
    }
    std::vector<std::uint8_t> memory(stream.size);
    std::ifstream(folder.path / "ram", std::ios::binary)
        .read(reinterpret_cast<char *>(memory.data()), static_cast<std::streamsize>(memory.size()));
    return memory;
}

} // namespace fledge::emulator::testing
