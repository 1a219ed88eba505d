// Evaluate a model file at the commands of a file, for test_elastocal_model_header.py.
//
// evaluate MODEL REGRESSION predict|rigid|correct|extrapolated|time < rows > rows, doubles.

#include <cstdio>
#include <cstring>
#include <ctime>
#include <iostream>

#include "elastocal_model.hpp"

namespace {

std::vector<double> read_row(std::size_t width) {
  std::vector<double> row(width);
  if (std::fread(row.data(), sizeof(double), width, stdin) != width) row.clear();
  return row;
}

void write_row(const double* values, std::size_t width) {
  std::fwrite(values, sizeof(double), width, stdout);
}

struct Row {
  Row(const std::vector<double>& values, std::size_t joints)
      : command(values.begin(), values.begin() + static_cast<long>(joints)) {
    const double* rest = values.data() + joints;
    std::copy(rest, rest + 6, wrench.begin());
    if (values.size() == joints + 6) return;
    std::copy(rest + 6, rest + 9, wanted.position.begin());
    for (std::size_t i = 0; i < 3; ++i)
      std::copy(rest + 9 + 3 * i, rest + 12 + 3 * i, wanted.rotation[i].begin());
  }
  std::vector<double> command;
  elastocal::Wrench wrench{};
  elastocal::Pose wanted;
};

// Shortest time of an evaluation of a row over several passes, in microseconds of the
// processor, because other programs share the machine.
template <typename Evaluate>
double find_shortest_us(const std::vector<Row>& rows, Evaluate evaluate) {
  double shortest = 1e9;
  for (int pass = 0; pass < 20; ++pass) {
    const std::clock_t begin = std::clock();
    for (const Row& row : rows) evaluate(row);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    shortest = std::min(shortest, 1e6 * seconds / static_cast<double>(rows.size()));
  }
  return shortest;
}

}  // namespace

int main(int, char** arguments) {
  try {
    const std::string what(arguments[3]);
    const auto model = elastocal::Model::load(arguments[1], std::strcmp(arguments[2], "0") != 0);
    elastocal::Workspace workspace(model);
    const std::size_t joints = model.commands();
    const bool corrects = what == "correct" || what == "time";
    // Command or start, wrench, and the wanted pose of a correction.
    const std::size_t width = joints + 6 + (corrects ? 12 : 0);
    std::vector<Row> rows;
    for (auto row = read_row(width); !row.empty(); row = read_row(width))
      rows.emplace_back(row, joints);
    if (what == "time") {
      const auto correct = [&](const Row& row) {
        model.correct(row.wanted, row.command, row.wrench, workspace);
      };
      const auto predict = [&](const Row& row) {
        model.predict(row.command, row.wrench, workspace);
      };
      std::cout << find_shortest_us(rows, correct) << " " << find_shortest_us(rows, predict)
                << "\n";
      return 0;
    }
    for (const Row& row : rows) {
      if (what == "correct") {
        const auto correction = model.correct(row.wanted, row.command, row.wrench, workspace);
        const double converged = correction.converged ? 1.0 : 0.0;
        write_row(correction.joint_angles.data(), joints);
        write_row(correction.error.data(), 6);
        write_row(&converged, 1);
      } else if (what == "predict" || what == "rigid") {
        const auto pose = what == "rigid" ? model.rigid(row.command, workspace)
                                          : model.predict(row.command, row.wrench, workspace);
        write_row(pose.position.data(), 3);
        for (const auto& line : pose.rotation) write_row(line.data(), 3);
      } else {
        const double beyond = model.is_extrapolated(row.command, row.wrench, workspace) ? 1.0 : 0.0;
        write_row(&beyond, 1);
      }
    }
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
