// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/support/scrape.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <sstream>

namespace vorocast::support {
namespace {

std::string Get(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(std::atoi(address.c_str() + colon + 1)));
  inet_pton(AF_INET, address.substr(0, colon).c_str(), &to.sin_addr);
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  const std::string request = "GET /metrics HTTP/1.0\r\nHost: " + address + "\r\nConnection: close\r\n\r\n";
  std::string answer;
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof(to)) == 0 &&
      ::write(socket, request.data(), request.size()) == static_cast<ssize_t>(request.size())) {
    char block[4096];
    for (ssize_t count; (count = ::read(socket, block, sizeof(block))) > 0;) answer.append(block, static_cast<std::size_t>(count));
  }
  ::close(socket);
  return answer;
}

}  // namespace

std::map<std::string, double> Scrape(const std::string& address) {
  std::map<std::string, double> samples;
  const std::string answer = Get(address);
  const std::size_t body = answer.find("\r\n\r\n");
  EXPECT_NE(answer.find(" 200 "), std::string::npos) << answer.substr(0, 200);
  if (body == std::string::npos) return samples;
  std::istringstream lines(answer.substr(body + 4));
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::size_t blank = line.rfind(' ');
    char* end = nullptr;
    const double value = blank == std::string::npos ? 0 : std::strtod(line.c_str() + blank, &end);
    EXPECT_TRUE(end && *end == 0) << line;
    EXPECT_TRUE(samples.emplace(line.substr(0, blank), value).second) << "twice: " << line;
  }
  return samples;
}

}  // namespace vorocast::support
