// SPDX-License-Identifier: Apache-2.0
// AES-GCM against the vectors of McGrew and Viega; files of keys, with all that can be wrong with them.
#include "ccsds/security/key_file.h"
#include "ccsds/testing/bits.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace security_test {

using namespace ccsds::testing;

/// Vectors of "The Galois/Counter Mode of Operation (GCM)", appendix B, that have 96 bits of initialisation vector: 1
/// to 4 with AES-128, 7 to 10 with AES-192, 13 to 16 with AES-256.
constexpr struct {
    int key; // [bytes]: of zeros, or of `feffe9928665731c6d6a8f9467308308` repeated
    bool zeros;
    std::size_t n; // of the text
    bool head;
    const char *cipher, *tag;
} vectors[] = {
    {16, true, 0, false, "", "58e2fccefa7e3061367f1d57a4e7455a"},
    {16, true, 16, false, "0388dace60b6a392f328c2b971b2fe78", "ab6e47d42cec13bdf53a67b21257bddf"},
    {16, false, 64, false,
     "42831ec2217774244b7221b784d0d49ce3aa212f2c02a4e035c17e2329aca12e21d514b25466931c7d8f6a5aac84aa051ba30b396a0aac97"
     "3d58e091473f5985",
     "4d5c2af327cd64a62cf35abd2ba6fab4"},
    {16, false, 60, true,
     "42831ec2217774244b7221b784d0d49ce3aa212f2c02a4e035c17e2329aca12e21d514b25466931c7d8f6a5aac84aa051ba30b396a0aac97"
     "3d58e091",
     "5bc94fbc3221a5db94fae95ae7121a47"},
    {24, true, 0, false, "", "cd33b28ac773f74ba00ed1f312572435"},
    {24, true, 16, false, "98e7247c07f0fe411c267e4384b0f600", "2ff58d80033927ab8ef4d4587514f0fb"},
    {24, false, 64, false,
     "3980ca0b3c00e841eb06fac4872a2757859e1ceaa6efd984628593b40ca1e19c7d773d00c144c525ac619d18c84a3f4718e2448b2fe324d9"
     "ccda2710acade256",
     "9924a7c8587336bfb118024db8674a14"},
    {24, false, 60, true,
     "3980ca0b3c00e841eb06fac4872a2757859e1ceaa6efd984628593b40ca1e19c7d773d00c144c525ac619d18c84a3f4718e2448b2fe324d9"
     "ccda2710",
     "2519498e80f1478f37ba55bd6d27618c"},
    {32, true, 0, false, "", "530f8afbc74536b9a963b4f1c4cb738b"},
    {32, true, 16, false, "cea7403d4d606b6e074ec5d3baf39d18", "d0d1c8a799996bf0265b98b5d48ab919"},
    {32, false, 64, false,
     "522dc1f099567d07f47f37a32a84427d643a8cdcbfe5c0c97598a2bd2555d1aa8cb08e48590dbb3da7b08b1056828838c5f61e6393ba7a0a"
     "bcc9f662898015ad",
     "b094dac5d93471bdec1a502270e3cc6c"},
    {32, false, 60, true,
     "522dc1f099567d07f47f37a32a84427d643a8cdcbfe5c0c97598a2bd2555d1aa8cb08e48590dbb3da7b08b1056828838c5f61e6393ba7a0a"
     "bcc9f662",
     "76fc6ece0f4e1768cddf8853bb2d551b"},
};

TEST(AesGcm, has_the_published_vectors)
{
    const Bytes text =
        from_hex("d9313225f88406e5a55909c5aff5269a86a7a9531534f7da2e4c303d8a318a721c3c0c95956809532fcf0e24"
                 "49a6b525b16aedf5aa0de657ba637b391aafd255");
    const Bytes head = from_hex("feedfacedeadbeeffeedfacedeadbeefabaddad2");
    Bytes key = from_hex("feffe9928665731c6d6a8f9467308308");
    key.insert(key.end(), key.begin(), key.end());
    const Bytes zeros(32), none;
    for (const auto &vector : vectors) {
        AesGcmKey expanded{};
        ASSERT_TRUE(
            aes_gcm_expand(&expanded, 3, (vector.zeros ? zeros : key).data(), static_cast<std::size_t>(vector.key)));
        AesGcmKeys keys{&expanded, 1};
        const SdlsCipher cipher = aes_gcm(&keys);
        Bytes data =
            vector.zeros ? Bytes(vector.n) : Bytes(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(vector.n));
        const Bytes plain = data, nonce = vector.zeros ? Bytes(12) : from_hex("cafebabefacedbaddecaf888");
        const Bytes &front = vector.head ? head : none;
        Bytes tag(16), again(16);
        const SdlsText seal{front.data(), front.size(), data.data(), data.size(), 1, 0};
        ASSERT_TRUE(cipher.run(cipher.user, 3, nonce.data(), &seal, tag.data()));
        EXPECT_EQ(data, from_hex(vector.cipher));
        EXPECT_EQ(tag, from_hex(vector.tag));
        const SdlsText opened{front.data(), front.size(), data.data(), data.size(), 1, 1};
        ASSERT_TRUE(cipher.run(cipher.user, 3, nonce.data(), &opened, again.data()));
        EXPECT_EQ(data, plain);
        EXPECT_EQ(again, tag);
        EXPECT_FALSE(cipher.run(cipher.user, 4, nonce.data(), &seal, tag.data())); // no such key
        EXPECT_FALSE(aes_gcm_expand(&expanded, 3, key.data(), static_cast<std::size_t>(vector.key) - 1));
    }
}

TEST(AesGcm, what_is_only_authenticated_is_as_if_it_stood_in_front)
{
    std::mt19937 random(1);
    const Bytes key = any_bytes(random, 32), vector = any_bytes(random, 12), head = any_bytes(random, 20);
    AesGcmKey expanded{};
    ASSERT_TRUE(aes_gcm_expand(&expanded, 1, key.data(), key.size()));
    AesGcmKeys keys{&expanded, 1};
    const SdlsCipher cipher = aes_gcm(&keys);
    for (std::size_t n = 0; n < 70; n++) {
        Bytes data = any_bytes(random, n), all = head, tag(16), expected(16);
        const Bytes before = data;
        all.insert(all.end(), data.begin(), data.end());
        const SdlsText text{head.data(), head.size(), data.data(), n, 0, 0},
            front{all.data(), all.size(), nullptr, 0, 1, 0};
        ASSERT_TRUE(cipher.run(cipher.user, 1, vector.data(), &text, tag.data()));
        ASSERT_TRUE(cipher.run(cipher.user, 1, vector.data(), &front, expected.data()));
        ASSERT_EQ(tag, expected);
        ASSERT_EQ(data, before);
    }
}

/// What is wrong with a file of keys that has this text; "" if nothing is.
std::string wrong_with(const std::string &text, unsigned mode = 0600, std::size_t room = 3)
{
    const std::string path = ::testing::TempDir() + "/fledge_link.keys";
    std::filesystem::remove(path);
    std::ofstream(path) << text;
    std::filesystem::permissions(path, static_cast<std::filesystem::perms>(mode));
    std::vector<AesGcmKey> keys(room);
    char why[400] = "";
    const std::size_t n = key_file_read(path.c_str(), keys.data(), room, why, sizeof why);
    EXPECT_EQ(n == 0, why[0] != '\0');
    std::string found = why;
    EXPECT_TRUE(found.empty() || found.rfind(path, 0) == 0) << found;
    return found.empty() ? "" : found.substr(path.size());
}

TEST(KeyFile, is_read_or_refused_with_what_to_do)
{
    const std::string key = "000102030405060708090a0b0c0d0e0f101112131415161718191A1B1C1D1E1F";
    const std::string form = ": a line is the id of a key, 1 to 65535, a space, and the key in hex",
                      size = ": a key is 32, 48 or 64 hex digits; ./fledge keys link FILE makes one";
    EXPECT_EQ(wrong_with("# of the link\n\n1 " + key + "\n65535\t" + key.substr(0, 48) + " \r\n7 " + key.substr(0, 32)),
              "");
    EXPECT_EQ(wrong_with("1 " + key + "\n", 0640),
              ": others may read these secret keys; chmod 600 keeps them yours, and if they might have, make new ones");
    EXPECT_EQ(wrong_with("1 " + key + "\n", 0604), wrong_with("1 " + key + "\n", 0620));
    EXPECT_EQ(wrong_with(""), ": it holds no key; ./fledge keys link FILE makes one");
    EXPECT_EQ(wrong_with("\n0 " + key), ", line 2" + form);
    EXPECT_EQ(wrong_with("65536 " + key), ", line 1" + form);
    EXPECT_EQ(wrong_with("-18446744073709551615 " + key), ", line 1" + form); // 1, without its sign
    EXPECT_EQ(wrong_with(key), ", line 1" + form);
    EXPECT_EQ(wrong_with("1 " + key.substr(2)), ", line 1" + size);
    EXPECT_EQ(wrong_with("1 " + key + "20"), ", line 1" + size);
    EXPECT_EQ(wrong_with("1 " + key.substr(1)), ", line 1" + size);
    EXPECT_EQ(wrong_with("1 g" + key.substr(1)), ", line 1" + size);
    EXPECT_EQ(wrong_with("1 " + key + "\n1 " + key), ", line 2: an earlier line has this id; give each key its own");
    EXPECT_EQ(wrong_with("1 " + key + "\n2 " + key, 0600, 1), ", line 2: more keys than this program takes");
    char why[400] = "";
    EXPECT_EQ(key_file_read("/nowhere/link.keys", nullptr, 0, why, sizeof why), 0u);
    EXPECT_EQ(std::string(why),
              "/nowhere/link.keys: No such file or directory; ./fledge keys link FILE makes a file of keys");
    EXPECT_EQ(key_file_read("/", nullptr, 0, why, sizeof why), 0u);
    EXPECT_EQ(std::string(why), "/: this is no file of keys");
}

} // namespace security_test
