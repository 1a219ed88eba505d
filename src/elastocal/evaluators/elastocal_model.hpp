// Evaluate a calibrated robot of elastocal in C++17, without dependencies.
//
//     const auto model = elastocal::Model::load("arm.elastocal.json");
//     elastocal::Workspace workspace(model);
//     const elastocal::Pose pose = model.predict(joint_angles, wrench, workspace);
//     const elastocal::Correction correction = model.correct(pose, start, wrench, workspace);
//
// This file may be copied; docs/model_file.md of elastocal explains the format that it
// reads. Angles are in rad (of prismatic joints m), lengths in m, wrenches in N and N m,
// all in base axes. A model is read-only, so that threads may share it; each thread needs a
// workspace. Nothing is allocated after the workspace has been made, except in the results.

#ifndef ELASTOCAL_MODEL_HPP
#define ELASTOCAL_MODEL_HPP

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <locale>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace elastocal {

using Vector3 = std::array<double, 3>;
using Matrix3 = std::array<Vector3, 3>;
// Force and moment at the origin of the last measuring point's frame.
using Wrench = std::array<double, 6>;

// Position and rotation of the last measuring point; rotation[row][column].
struct Pose {
  Vector3 position{};
  Matrix3 rotation{};
};

// Commands that reach a wanted pose, as the controller reports them.
struct Correction {
  std::vector<double> joint_angles;
  // Wanted less predicted pose, m and rad.
  std::array<double, 6> error{};
  // Whether Newton's method has ended at an error below a tenth of a nanometre.
  bool converged = false;
};

namespace detail {

inline Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline double dot(const Vector3& a, const Vector3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Written out, because compilers do not unroll loops at -O2.
inline Vector3 scaled(const Vector3& vector, double factor) {
  return {factor * vector[0], factor * vector[1], factor * vector[2]};
}

inline void add_scaled(Vector3& sum, const Vector3& vector, double factor) {
  sum[0] += factor * vector[0];
  sum[1] += factor * vector[1];
  sum[2] += factor * vector[2];
}

inline double norm(const double* first) {
  return std::sqrt(first[0] * first[0] + first[1] * first[1] + first[2] * first[2]);
}

// A value of a JSON document. Escapes in texts stay as they are written.
struct Json {
  enum class Kind { null, boolean, number, text, list, object };
  Kind kind = Kind::null;
  double number = 0.0;
  std::string text;
  std::vector<Json> items;
  std::vector<std::pair<std::string, Json>> members;

  const Json* find(const std::string& key) const {
    for (const auto& member : members)
      if (member.first == key) return &member.second;
    return nullptr;
  }
  const Json& at(const std::string& key) const {
    if (const Json* value = find(key)) return *value;
    throw std::runtime_error("model file: no key " + key);
  }
  int integer(const std::string& key) const { return static_cast<int>(at(key).number); }
  // The value as an index below a size.
  int index(std::size_t size, std::size_t first = 0) const {
    if (kind != Kind::number || number < static_cast<double>(first) ||
        number >= static_cast<double>(size))
      throw std::runtime_error("model file: no index where one is needed");
    return static_cast<int>(number);
  }
  std::vector<double> numbers() const {
    std::vector<double> values;
    values.reserve(items.size());
    for (const Json& item : items) values.push_back(item.number);
    return values;
  }
  Vector3 vector() const {
    if (items.size() != 3) throw std::runtime_error("model file: no vector");
    return {items[0].number, items[1].number, items[2].number};
  }
};

class JsonReader {
 public:
  explicit JsonReader(const std::string& text) : text_(text) {}

  Json read() {
    Json value = read_value(0);
    skip_blanks();
    if (at_ != text_.size()) fail();
    return value;
  }

 private:
  // No model file is nested as deeply.
  static constexpr int deepest = 64;
  const std::string& text_;
  std::size_t at_ = 0;

  [[noreturn]] void fail() const {
    throw std::runtime_error("model file: no JSON at character " + std::to_string(at_));
  }
  void skip_blanks() {
    while (at_ < text_.size() && std::string(" \t\r\n").find(text_[at_]) != std::string::npos)
      ++at_;
  }
  char peek() {
    skip_blanks();
    if (at_ >= text_.size()) fail();
    return text_[at_];
  }
  bool take(char expected) {
    if (peek() != expected) return false;
    ++at_;
    return true;
  }
  void expect(char expected) {
    if (!take(expected)) fail();
  }
  bool take_word(const char* word) {
    const std::string expected(word);
    if (text_.compare(at_, expected.size(), expected) != 0) return false;
    at_ += expected.size();
    return true;
  }

  Json read_value(int depth) {
    if (depth > deepest) fail();
    Json value;
    switch (peek()) {
      case '{':
        value.kind = Json::Kind::object;
        read_members(value, depth);
        break;
      case '[':
        value.kind = Json::Kind::list;
        read_items(value, depth);
        break;
      case '"':
        value.kind = Json::Kind::text;
        value.text = read_text();
        break;
      default:
        read_scalar(value);
    }
    return value;
  }
  void read_members(Json& value, int depth) {
    expect('{');
    if (take('}')) return;
    do {
      if (peek() != '"') fail();
      std::string key = read_text();
      expect(':');
      value.members.emplace_back(std::move(key), read_value(depth + 1));
    } while (take(','));
    expect('}');
  }
  void read_items(Json& value, int depth) {
    expect('[');
    if (take(']')) return;
    do {
      value.items.push_back(read_value(depth + 1));
    } while (take(','));
    expect(']');
  }
  std::string read_text() {
    expect('"');
    const std::size_t start = at_;
    while (at_ < text_.size() && text_[at_] != '"') at_ += text_[at_] == '\\' ? 2 : 1;
    if (at_ >= text_.size()) fail();
    return text_.substr(start, at_++ - start);
  }
  void read_scalar(Json& value) {
    if (take_word("null")) return;
    const bool is_true = take_word("true");
    if (is_true || take_word("false")) {
      value.kind = Json::Kind::boolean;
      value.number = is_true ? 1.0 : 0.0;
      return;
    }
    const std::size_t start = at_;
    while (at_ < text_.size() &&
           std::string("+-.eE0123456789").find(text_[at_]) != std::string::npos)
      ++at_;
    value.kind = Json::Kind::number;
    if (at_ == start || !parse(start, value.number)) fail();
  }
  // A number must not depend on the locale of the program.
  bool parse(std::size_t start, double& number) const {
#if defined(__cpp_lib_to_chars)
    const char* first = text_.data() + start;
    const char* last = text_.data() + at_;
    const auto result = std::from_chars(first, last, number);
    return result.ec == std::errc() && result.ptr == last;
#else
    std::istringstream stream(text_.substr(start, at_ - start));
    stream.imbue(std::locale::classic());
    stream >> number;
    return !stream.fail() && stream.eof();
#endif
  }
};

// Axes of a frame, and its origin.
struct Frame {
  Matrix3 axes{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
  Vector3 origin{};

  Vector3 place(const Vector3& local) const {
    Vector3 point = origin;
    add_scaled(point, axes[0], local[0]);
    add_scaled(point, axes[1], local[1]);
    add_scaled(point, axes[2], local[2]);
    return point;
  }
  void shift(int axis, double amount) {
    add_scaled(origin, axes[static_cast<std::size_t>(axis)], amount);
  }
  void turn(int axis, double cosine, double sine) {
    switch (axis) {
      case 0:
        turn(axes[1], axes[2], cosine, sine);
        break;
      case 1:
        turn(axes[2], axes[0], cosine, sine);
        break;
      default:
        turn(axes[0], axes[1], cosine, sine);
    }
  }
  static void turn(Vector3& second, Vector3& third, double cosine, double sine) {
    const Vector3 before = second;
    second = {cosine * before[0] + sine * third[0], cosine * before[1] + sine * third[1],
              cosine * before[2] + sine * third[2]};
    third = {cosine * third[0] - sine * before[0], cosine * third[1] - sine * before[1],
             cosine * third[2] - sine * before[2]};
  }
};

// Cosine and sine. Most coordinates are small errors, for which the first terms of the
// series are exact to rounding.
inline void cosine_and_sine(double angle, double& cosine, double& sine) {
  if (std::abs(angle) < 1e-2) {
    const double square = angle * angle;
    cosine = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square / 720.0));
    sine = angle * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0)));
    return;
  }
  cosine = std::cos(angle);
  sine = std::sin(angle);
}

struct Transform {
  bool turns = false;
  int axis = 0;
  int coordinate = -1;
  double sign = 1.0;
  double constant = 0.0;
  double cosine = 1.0;
  double sine = 0.0;
};

// Velocity of the body's point at the base's origin, and angular velocity.
struct Twist {
  Vector3 linear{};
  Vector3 angular{};

  double power(const Wrench& wrench) const {
    return linear[0] * wrench[0] + linear[1] * wrench[1] + linear[2] * wrench[2] +
           angular[0] * wrench[3] + angular[1] * wrench[4] + angular[2] * wrench[5];
  }
};

struct Body {
  int after = 0;
  double mass = 0.0;
  Vector3 moment{};
  bool loads_joints = true;
};

enum class Limit { none, tanh, clip };

struct Term {
  int coordinate = 0;
  double value = 0.0;
  int phase = -1;
  bool sine = false;
  std::vector<int> angles;
  std::vector<int> loads;
  Limit limit = Limit::none;
  int limited = 0;
  double threshold = 1.0;
  int weighed_joint = -1;
  Body body;
  // Its factors but that of the angles and a limit.
  std::vector<std::size_t> factors;

  // Add a term with the same factors but value and weight; false if it has others.
  bool merge(const Term& other) {
    const bool is_alike =
        coordinate == other.coordinate && phase == other.phase && sine == other.sine &&
        angles == other.angles && loads == other.loads && limit == other.limit &&
        weighed_joint == other.weighed_joint &&
        (limit == Limit::none || (limited == other.limited && threshold == other.threshold)) &&
        (weighed_joint < 0 || body.after == other.body.after);
    if (!is_alike) return false;
    if (weighed_joint < 0) {
      value += other.value;
      return true;
    }
    for (std::size_t i = 0; i < 3; ++i)
      body.moment[i] = value * body.moment[i] + other.value * other.body.moment[i];
    body.mass = value * body.mass + other.value * other.body.mass;
    value = 1.0;
    return true;
  }
};

// The weight of a body as a load on a joint.
struct Weight {
  std::size_t joint = 0;
  Body body;
};

// A term whose only factor besides that of the angles is a load, in little memory.
struct LinearTerm {
  std::size_t number, coordinate, load;
};

// The terms of a model by what they depend on.
struct Terms {
  std::vector<Term> all;
  // On angles alone, on one load as well, and on anything else.
  std::vector<std::size_t> fixed, others;
  std::vector<LinearTerm> linear;
  // Those whose factor changes with the angles; most springs are constant.
  std::vector<std::size_t> varying;

  void add(const Term& term) {
    for (Term& known : all)
      if (known.merge(term)) return;
    all.push_back(term);
  }

  // Sort the terms, and list the weights that are loads besides those of the coordinates.
  void arrange(std::size_t coordinates, std::vector<Weight>& weights) {
    for (std::size_t number = 0; number < all.size(); ++number) {
      Term& term = all[number];
      term.factors.assign(term.loads.begin(), term.loads.end());
      if (term.weighed_joint >= 0) {
        term.factors.push_back(coordinates + weights.size());
        weights.push_back({static_cast<std::size_t>(term.weighed_joint), term.body});
      }
      if (term.limit != Limit::none || term.factors.size() > 1)
        others.push_back(number);
      else if (term.factors.empty())
        fixed.push_back(number);
      else
        linear.push_back(
            {number, static_cast<std::size_t>(term.coordinate), term.factors.front()});
      if (term.phase >= 0 || !term.angles.empty()) varying.push_back(number);
    }
  }

  // The values of all terms, which are the factors of those that no angle changes.
  std::vector<double> values() const {
    std::vector<double> values;
    for (const Term& term : all) values.push_back(term.value);
    return values;
  }
};

// A linear combination of joint angles, whose cosine and sine terms share.
using Phase = std::vector<std::pair<int, double>>;

struct Range {
  std::vector<double> low;
  std::vector<double> high;
  double force = 0.0;
  double moment = 0.0;

  explicit Range(const Json& json)
      : low(json.at("low").numbers()),
        high(json.at("high").numbers()),
        force(json.at("force_N").number),
        moment(json.at("moment_Nm").number) {}

  bool contains(const std::vector<double>& angles, const Wrench& wrench) const {
    for (std::size_t joint = 0; joint < low.size(); ++joint)
      if (angles[joint] < low[joint] || angles[joint] > high[joint]) return false;
    return norm(wrench.data()) <= force && norm(wrench.data() + 3) <= moment;
  }
};

// An input of a regression: a joint angle, a component of the wrench, or of the position of
// the target.
inline double get_input(int column, const std::vector<double>& angles, const Wrench& wrench,
                        const Vector3& target_offset) {
  const auto number = static_cast<std::size_t>(column);
  if (number < angles.size()) return angles[number];
  if (number < angles.size() + 6) return wrench[number - angles.size()];
  return target_offset[number - angles.size() - 6];
}

// The mean of regression trees, which were grown on inputs in single precision.
struct Forest {
  struct Node {
    int column = -1;
    double threshold = 0.0;
    std::array<int, 2> children{};
    Vector3 value{};
  };
  Vector3 target_offset{};
  std::vector<std::vector<Node>> trees;

  Vector3 mean(const std::vector<double>& angles, const Wrench& wrench) const {
    Vector3 sum{};
    for (const std::vector<Node>& tree : trees) {
      const Node* node = tree.data();
      while (node->column >= 0) {
        const double input = get_input(node->column, angles, wrench, target_offset);
        const bool is_beyond = static_cast<double>(static_cast<float>(input)) > node->threshold;
        node = tree.data() + node->children[is_beyond ? 1 : 0];
      }
      for (std::size_t i = 0; i < 3; ++i) sum[i] += node->value[i];
    }
    for (double& component : sum) component /= static_cast<double>(trees.size());
    return sum;
  }
};

// The mean of a Gaussian process with a Matern kernel of order 5/2.
struct Process {
  std::vector<int> columns;
  Vector3 target_offset{};
  std::vector<double> center, scale, points, weights;
  Vector3 offset{}, size{};

  Vector3 mean(const std::vector<double>& angles, const Wrench& wrench,
               std::vector<double>& scaled) const {
    const std::size_t width = columns.size();
    for (std::size_t i = 0; i < width; ++i) {
      const double input = get_input(columns[i], angles, wrench, target_offset);
      scaled[i] = (input - center[i]) / scale[i];
    }
    Vector3 sum{};
    for (std::size_t point = 0; point * width < points.size(); ++point) {
      double square = 0.0;
      for (std::size_t i = 0; i < width; ++i) {
        const double difference = scaled[i] - points[point * width + i];
        square += difference * difference;
      }
      const double root = std::sqrt(5.0 * square);
      const double kernel = (1.0 + root + root * root / 3.0) * std::exp(-root);
      for (int i = 0; i < 3; ++i) sum[i] += kernel * weights[3 * point + i];
    }
    for (int i = 0; i < 3; ++i) sum[i] = offset[i] + size[i] * sum[i];
    return sum;
  }
};

// Solve a system of six equations by elimination with pivots; matrix is overwritten.
inline bool solve6(std::array<std::array<double, 6>, 6>& matrix, std::array<double, 6>& right) {
  for (int column = 0; column < 6; ++column) {
    int pivot = column;
    for (int row = column + 1; row < 6; ++row)
      if (std::abs(matrix[row][column]) > std::abs(matrix[pivot][column])) pivot = row;
    if (matrix[pivot][column] == 0.0) return false;
    std::swap(matrix[pivot], matrix[column]);
    std::swap(right[pivot], right[column]);
    for (int row = column + 1; row < 6; ++row) {
      const double factor = matrix[row][column] / matrix[column][column];
      for (int k = column; k < 6; ++k) matrix[row][k] -= factor * matrix[column][k];
      right[row] -= factor * right[column];
    }
  }
  for (int row = 5; row >= 0; --row) {
    for (int k = row + 1; k < 6; ++k) right[row] -= matrix[row][k] * right[k];
    right[row] /= matrix[row][row];
  }
  return true;
}

// Rotation vector from one orientation to another, less than half a turn.
inline Vector3 rotation_vector(const Matrix3& rotation, const Matrix3& start) {
  Matrix3 relative{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) relative[i][j] = dot(rotation[i], start[j]);
  Vector3 skew{0.5 * (relative[2][1] - relative[1][2]), 0.5 * (relative[0][2] - relative[2][0]),
               0.5 * (relative[1][0] - relative[0][1])};
  const double sine = norm(skew.data());
  const double cosine = 0.5 * (relative[0][0] + relative[1][1] + relative[2][2] - 1.0);
  const double ratio = sine > 0.0 ? std::atan2(sine, cosine) / sine : 1.0;
  for (double& component : skew) component *= ratio;
  return skew;
}

}  // namespace detail

class Model;

// Memory of one evaluation; each thread needs its own.
class Workspace {
 public:
  explicit Workspace(const Model& model);

 private:
  friend class Model;
  std::vector<double> angles, fixed, coordinates, displacement, loads, factors, series_factors;
  std::vector<double> cosines, sines, multiples, scaled;
  std::vector<detail::Twist> twists;
  // For each joint what the weight of a body's mass and of its first moment does.
  std::vector<double> sinkings;
  std::vector<Vector3> lowerings;
  std::vector<detail::Frame> frames;
  std::vector<std::array<double, 6>> directions, jacobian;
  detail::Frame end;
};

// A calibrated robot, read from a model file.
class Model {
 public:
  // Throws std::runtime_error if the file is no model file, or if its regression has no
  // formula; then pass false to leave out the regression.
  static Model load(const std::string& path, bool regression = true) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw std::runtime_error(path + ": no such file");
    std::ostringstream text;
    text << file.rdbuf();
    return Model(text.str(), regression);
  }

  explicit Model(const std::string& text, bool regression = true)
      : Model(detail::JsonReader(text).read(), regression) {}

  // Number of joints of the chain.
  std::size_t joints() const { return joints_; }

  // Number of joint angles of a command, fewer than joints if some follow others.
  std::size_t commands() const { return commands_; }

  // Names of the joints that are commanded, or joint1 and so on if the model has none.
  const std::vector<std::string>& command_names() const { return command_names_; }

  // Predict where the robot comes to rest at commands, as the controller reports them.
  Pose predict(const std::vector<double>& joint_angles, const Wrench& wrench,
               Workspace& workspace) const {
    set_angles(joint_angles, workspace);
    come_to_rest(wrench, workspace);
    Pose pose = get_pose(workspace);
    const Vector3 moved = correct_residual(wrench, workspace);
    for (int i = 0; i < 3; ++i) pose.position[i] += moved[i];
    return pose;
  }

  // Pose of the rigid, nominal robot at a command, for which an uncorrected program was
  // made.
  Pose rigid(const std::vector<double>& joint_angles, Workspace& workspace) const {
    set_angles(joint_angles, workspace);
    walk(workspace, true);
    return get_pose(workspace);
  }

  // Decide whether a command is beyond the fitted joint angles and loads.
  bool is_extrapolated(const std::vector<double>& joint_angles, const Wrench& wrench,
                       Workspace& workspace) const {
    set_angles(joint_angles, workspace);
    return !range_.contains(workspace.angles, wrench);
  }

  // Find the commands that reach a wanted pose, by Newton's method. The start are
  // uncorrected commands, at which the rigid robot has this pose.
  Correction correct(const Pose& wanted, const std::vector<double>& start, const Wrench& wrench,
                     Workspace& workspace) const {
    if (commands_ < 6) throw std::invalid_argument("correct needs six joints or more");
    set_angles(start, workspace);
    walk(workspace, true);
    compute_jacobian(workspace, workspace.jacobian);
    workspace.directions = restrict_to_commands(workspace.jacobian);
    evaluate_loads(wrench, workspace);
    Correction correction;
    Vector3 moved{};
    // What an approach has to add to the wanted pose, so that a prediction reaches it.
    std::array<double, 6> aim{};
    for (int rest = 0; rest < most_rests; ++rest) {
      const bool is_last = rest > 0 && find_largest(correction.error) < settled_m;
      if (!approach(wanted, aim, wrench, is_last, correction.error, workspace)) break;
      if (!is_last) {
        come_to_rest(wrench, workspace);
        if (rest <= regression_steps) moved = correct_residual(wrench, workspace);
        correction.error = find_error(wanted, workspace);
        for (std::size_t i = 0; i < 3; ++i) correction.error[i] -= moved[i];
        for (std::size_t i = 0; i < 6; ++i) aim[i] += correction.error[i];
      }
      correction.converged = find_largest(correction.error) < converged_m;
      if (correction.converged || is_last) break;
    }
    correction.joint_angles = report_angles(workspace.angles);
    return correction;
  }

 private:
  friend class Workspace;
  using Jacobian = std::vector<std::array<double, 6>>;
  static constexpr int version = 1;
  // Steps of one approach, and predictions that check where it has led.
  static constexpr int most_steps = 20;
  static constexpr int most_rests = 12;
  static constexpr double converged_m = 1e-10;
  // Error of a prediction below which no other prediction is needed: the commands change so
  // little that the difference between a prediction and an approach stays the same.
  static constexpr double settled_m = 1e-7;
  // Error of which a step leaves less than the tolerance; each step leaves less than a
  // hundredth even in soft arms.
  static constexpr double approached_m = 1e-8;
  // Predictions after which a regression is no longer evaluated anew; one with jumps would keep
  // later steps from converging.
  static constexpr int regression_steps = 2;
  // Multiples of a joint angle up to this order come from a recurrence.
  static constexpr int most_multiples = 64;

  std::size_t joints_ = 0;
  std::size_t commands_ = 0;
  std::size_t coordinates_ = 0;
  std::vector<std::string> command_names_;
  int iterations_ = 0;
  std::vector<double> matrix_, inverse_, offset_;
  std::vector<detail::Transform> transforms_;
  // For each transform whether its coordinate needs a twist, and whether it ever moves.
  std::vector<char> twisted_, moved_;
  // Coordinates that move.
  std::vector<std::size_t> moving_;
  // Whether bodies load the coordinates of links but not the joints.
  bool weighs_links_ = false;
  // Coordinates whose loads are needed, from the end of the chain to the base.
  std::vector<int> loaded_;
  std::vector<int> index_;
  std::vector<char> framed_;
  Vector3 end_offset_{}, gravity_{};
  std::vector<detail::Body> bodies_;
  detail::Terms terms_, series_;
  std::vector<detail::Weight> weights_;
  std::vector<detail::Phase> phases_;
  // Orders of the phases that are multiples of one angle, else 0, and the largest of each
  // joint.
  std::vector<int> orders_, largest_orders_;
  detail::Range range_;
  std::vector<detail::Range> regression_range_;
  std::vector<detail::Process> process_;
  std::vector<detail::Forest> forest_;

  Model(const detail::Json& json, bool regression) : range_((check(json), json.at("range"))) {
    const detail::Json& kinematics = json.at("kinematics");
    joints_ = static_cast<std::size_t>(kinematics.integer("joints"));
    coordinates_ = static_cast<std::size_t>(kinematics.integer("coordinates"));
    iterations_ = kinematics.integer("load_iterations");
    largest_orders_.assign(joints_, 0);
    offset_ = kinematics.at("reported_offset").numbers();
    for (const detail::Json& row : kinematics.at("reported_matrix").items)
      for (double value : row.numbers()) matrix_.push_back(value);
    commands_ = matrix_.size() / joints_;
    inverse_ = invert_matrix();
    end_offset_ = kinematics.at("end_effector_offset_m").vector();
    gravity_ = kinematics.at("gravity_m_s2").vector();
    read_command_names(json.at("robot"));
    read_transforms(kinematics);
    for (const detail::Json& body : kinematics.at("bodies").items)
      bodies_.push_back(read_body(body, "mass_kg", "moment_kg_m"));
    read_terms(json.at("springs"), terms_);
    for (const detail::Json& effect : json.at("effects").items)
      read_terms(effect.at("terms"), terms_);
    const detail::Json& stated = json.at("regression");
    if (regression && stated.kind == detail::Json::Kind::object) read_regression(stated);
    plan_walk();
  }

  static void check(const detail::Json& json) {
    const detail::Json* format = json.find("format");
    if (!format || format->text != "elastocal model" || json.integer("version") != version)
      throw std::runtime_error("no elastocal model of version " + std::to_string(version));
  }

  void read_command_names(const detail::Json& robot) {
    const detail::Json* names = robot.find("joint_names");
    if (commands_ < joints_) names = nullptr;
    if (const detail::Json* reported = robot.find("reported_joints"))
      if (const detail::Json* stated = reported->find("names")) names = stated;
    for (std::size_t command = 0; command < commands_; ++command)
      command_names_.push_back(names ? names->items.at(command).text
                                     : "joint" + std::to_string(command + 1));
  }

  void read_transforms(const detail::Json& kinematics) {
    index_.assign(coordinates_, 0);
    for (const detail::Json& stated : kinematics.at("transforms").items) {
      detail::Transform transform;
      transform.turns = stated.at("kind").text == "R";
      transform.axis = stated.at("axis").text[0] - 'x';
      if (const detail::Json* sign = stated.find("sign")) transform.sign = sign->number;
      if (const detail::Json* constant = stated.find("constant"))
        transform.constant = transform.sign * constant->number;
      transform.cosine = std::cos(transform.constant);
      transform.sine = std::sin(transform.constant);
      const detail::Json* coordinate = stated.find("coordinate");
      if (coordinate && coordinate->kind == detail::Json::Kind::number) {
        transform.coordinate = coordinate->index(coordinates_);
        index_[static_cast<std::size_t>(transform.coordinate)] =
            static_cast<int>(transforms_.size());
      }
      transforms_.push_back(transform);
    }
  }

  detail::Body read_body(const detail::Json& stated, const char* mass, const char* moment) const {
    detail::Body body;
    body.after = stated.at("after").index(transforms_.size() + 1);
    body.mass = stated.at(mass).number;
    body.moment = stated.at(moment).vector();
    if (const detail::Json* loads = stated.find("loads_joints"))
      body.loads_joints = loads->number != 0.0;
    return body;
  }

  void read_terms(const detail::Json& list, detail::Terms& terms) {
    for (const detail::Json& stated : list.items) {
      detail::Term term;
      term.coordinate = stated.at("coordinate").index(coordinates_);
      term.value = stated.at("value").number;
      if (const detail::Json* wave = stated.find("wave")) term.sine = wave->text == "sin";
      if (const detail::Json* orders = stated.find("orders")) term.phase = find_phase(*orders);
      if (const detail::Json* angles = stated.find("angles"))
        for (const detail::Json& joint : angles->items) term.angles.push_back(joint.index(joints_));
      if (const detail::Json* loads = stated.find("loads"))
        for (const detail::Json& coordinate : loads->items)
          term.loads.push_back(coordinate.index(coordinates_));
      if (const detail::Json* limited = stated.find("limited")) {
        term.limit = limited->at("kind").text == "tanh" ? detail::Limit::tanh : detail::Limit::clip;
        term.limited = limited->at("coordinate").index(coordinates_);
        term.threshold = limited->at("limit").number;
      }
      if (const detail::Json* weight = stated.find("weight")) {
        term.weighed_joint = weight->at("joint").index(joints_);
        term.body = read_body(*weight, "mass", "moment");
      }
      terms.add(term);
    }
  }

  // Find a phase among those of earlier terms, or add it.
  int find_phase(const detail::Json& orders) {
    detail::Phase phase;
    for (const detail::Json& pair : orders.items)
      phase.emplace_back(pair.items.at(0).index(joints_), pair.items.at(1).number);
    const auto known = std::find(phases_.begin(), phases_.end(), phase);
    const int number = static_cast<int>(known - phases_.begin());
    if (known != phases_.end()) return number;
    const double order = phase.front().second;
    const bool is_multiple =
        phase.size() == 1 && order == std::floor(order) && order <= most_multiples;
    orders_.push_back(is_multiple ? static_cast<int>(order) : 0);
    int& largest = largest_orders_.at(static_cast<std::size_t>(phase.front().first));
    largest = std::max(largest, orders_.back());
    phases_.push_back(phase);
    return number;
  }

  void read_regression(const detail::Json& stated) {
    const detail::Json& law = stated.at("law");
    if (law.kind != detail::Json::Kind::object)
      throw std::runtime_error("the regression " + stated.at("name").text + " has no formula");
    regression_range_.emplace_back(stated.at("range"));
    if (const detail::Json* series = law.find("displacements")) {
      read_terms(*series, series_);
      return;
    }
    if (const detail::Json* trees = law.find("trees")) {
      forest_.emplace_back();
      forest_.back().target_offset = law.at("target_offset_m").vector();
      for (const detail::Json& tree : trees->items) forest_.back().trees.push_back(read_tree(tree));
      return;
    }
    detail::Process process;
    for (const detail::Json& column : law.at("columns").items)
      process.columns.push_back(column.index(joints_ + 9));
    process.target_offset = law.at("target_offset_m").vector();
    process.center = law.at("center").numbers();
    process.scale = law.at("spread").numbers();
    const std::vector<double> lengths = law.at("lengths").numbers();
    // Points are stated in lengths, inputs in spreads times lengths.
    for (std::size_t i = 0; i < lengths.size(); ++i) process.scale[i] *= lengths[i];
    for (const detail::Json& row : law.at("points").items)
      for (double value : row.numbers()) process.points.push_back(value);
    for (const detail::Json& row : law.at("weights").items)
      for (double value : row.numbers()) process.weights.push_back(value);
    process.offset = law.at("offset").vector();
    process.size = law.at("size").vector();
    process_.push_back(process);
  }

  std::vector<detail::Forest::Node> read_tree(const detail::Json& tree) const {
    std::vector<detail::Forest::Node> nodes(tree.at("column").items.size());
    for (std::size_t number = 0; number < nodes.size(); ++number) {
      detail::Forest::Node& node = nodes[number];
      const detail::Json& column = tree.at("column").items[number];
      node.column = column.number < 0.0 ? -1 : column.index(joints_ + 9);
      node.threshold = tree.at("threshold").items.at(number).number;
      const detail::Json& children = tree.at("children").items.at(number);
      // Children come after their parent, so that every path ends.
      for (std::size_t side = 0; node.column >= 0 && side < 2; ++side)
        node.children[side] = children.items.at(side).index(nodes.size(), number + 1);
      node.value = tree.at("value").items.at(number).vector();
    }
    return nodes;
  }

  // Decide which coordinates move, and of which the twists, loads and frames are needed.
  void plan_walk() {
    terms_.arrange(coordinates_, weights_);
    series_.arrange(coordinates_, weights_);
    std::vector<char> moves(coordinates_, 0), needs_load(coordinates_, 0),
        needs_twist(coordinates_, 0);
    for (std::size_t joint = 0; joint < joints_; ++joint) moves[joint] = needs_twist[joint] = 1;
    framed_.assign(transforms_.size() + 1, 0);
    for (const detail::Body& body : bodies_) framed_.at(static_cast<std::size_t>(body.after)) = 1;
    for (const detail::Term& term : terms_.all)
      moves.at(static_cast<std::size_t>(term.coordinate)) = 1;
    for (const detail::Term& term : series_.all)
      needs_twist.at(static_cast<std::size_t>(term.coordinate)) = 1;
    for (const detail::Terms* terms : {&terms_, &series_})
      for (const detail::Term& term : terms->all) {
        for (int coordinate : term.loads) needs_load.at(static_cast<std::size_t>(coordinate)) = 1;
        if (term.limit != detail::Limit::none)
          needs_load.at(static_cast<std::size_t>(term.limited)) = 1;
        if (term.weighed_joint >= 0) framed_.at(static_cast<std::size_t>(term.body.after)) = 1;
      }
    for (const detail::Transform& transform : transforms_) {
      const int coordinate = transform.coordinate;
      const bool is_free = coordinate >= 0;
      const auto k = static_cast<std::size_t>(is_free ? coordinate : 0);
      twisted_.push_back(is_free && (moves[k] || needs_twist[k] || needs_load[k]));
      moved_.push_back(!is_free || moves[k]);
    }
    for (std::size_t k = 0; k < coordinates_; ++k)
      if (moves[k]) moving_.push_back(k);
    for (const detail::Body& body : bodies_) weighs_links_ = weighs_links_ || !body.loads_joints;
    for (std::size_t k = 0; k < coordinates_; ++k)
      if (needs_load[k]) loaded_.push_back(static_cast<int>(k));
    std::sort(loaded_.begin(), loaded_.end(), [this](int first, int second) {
      return index_[static_cast<std::size_t>(first)] > index_[static_cast<std::size_t>(second)];
    });
    std::sort(bodies_.begin(), bodies_.end(),
              [](const detail::Body& first, const detail::Body& second) {
                return first.after > second.after;
              });
  }

  static std::vector<double> invert(std::vector<double> matrix, std::size_t size) {
    std::vector<double> inverse(size * size, 0.0);
    for (std::size_t i = 0; i < size; ++i) inverse[i * size + i] = 1.0;
    for (std::size_t column = 0; column < size; ++column) {
      std::size_t pivot = column;
      for (std::size_t row = column; row < size; ++row)
        if (std::abs(matrix[row * size + column]) > std::abs(matrix[pivot * size + column]))
          pivot = row;
      for (std::size_t k = 0; k < size; ++k) {
        std::swap(matrix[pivot * size + k], matrix[column * size + k]);
        std::swap(inverse[pivot * size + k], inverse[column * size + k]);
      }
      const double scale = 1.0 / matrix[column * size + column];
      for (std::size_t k = 0; k < size; ++k) {
        matrix[column * size + k] *= scale;
        inverse[column * size + k] *= scale;
      }
      for (std::size_t row = 0; row < size; ++row) {
        const double factor = row == column ? 0.0 : matrix[row * size + column];
        for (std::size_t k = 0; k < size; ++k) {
          matrix[row * size + k] -= factor * matrix[column * size + k];
          inverse[row * size + k] -= factor * inverse[column * size + k];
        }
      }
    }
    return inverse;
  }

  // Angles of the chain from those that the controller reports.
  // Find the reported angles of given joint angles: the inverse of the matrix or, if joints
  // follow others, its left inverse (M'M)^-1 M'.
  std::vector<double> invert_matrix() const {
    if (commands_ == joints_) return invert(matrix_, joints_);
    std::vector<double> gram(commands_ * commands_, 0.0);
    for (std::size_t i = 0; i < commands_; ++i)
      for (std::size_t j = 0; j < commands_; ++j)
        for (std::size_t k = 0; k < joints_; ++k)
          gram[i * commands_ + j] += matrix_[k * commands_ + i] * matrix_[k * commands_ + j];
    const std::vector<double> inverse_gram = invert(gram, commands_);
    std::vector<double> inverse(commands_ * joints_, 0.0);
    for (std::size_t i = 0; i < commands_; ++i)
      for (std::size_t k = 0; k < joints_; ++k)
        for (std::size_t j = 0; j < commands_; ++j)
          inverse[i * joints_ + k] += inverse_gram[i * commands_ + j] * matrix_[k * commands_ + j];
    return inverse;
  }

  // Restrict a Jacobian to motions that commands bring about, M (left inverse) J'.
  Jacobian restrict_to_commands(const Jacobian& jacobian) const {
    if (commands_ == joints_) return jacobian;
    Jacobian of_commands(commands_), restricted(joints_);
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t c = 0; c < commands_; ++c)
        for (std::size_t k = 0; k < joints_; ++k)
          of_commands[c][i] += inverse_[c * joints_ + k] * jacobian[k][i];
      for (std::size_t k = 0; k < joints_; ++k)
        for (std::size_t c = 0; c < commands_; ++c)
          restricted[k][i] += matrix_[k * commands_ + c] * of_commands[c][i];
    }
    return restricted;
  }

  void set_angles(const std::vector<double>& reported, Workspace& workspace) const {
    if (reported.size() != commands_) throw std::invalid_argument("another number of joints");
    for (std::size_t i = 0; i < joints_; ++i) {
      double angle = offset_[i];
      for (std::size_t j = 0; j < commands_; ++j) angle += matrix_[i * commands_ + j] * reported[j];
      workspace.angles[i] = angle;
    }
    evaluate_waves(workspace);
  }

  std::vector<double> report_angles(const std::vector<double>& angles) const {
    std::vector<double> reported(commands_, 0.0);
    for (std::size_t i = 0; i < commands_; ++i)
      for (std::size_t j = 0; j < joints_; ++j)
        reported[i] += inverse_[i * joints_ + j] * (angles[j] - offset_[j]);
    return reported;
  }

  // Evaluate all that depends on the joint angles alone.
  void evaluate_waves(Workspace& workspace) const {
    const std::size_t stride = 2 * (most_multiples + 1);
    for (std::size_t joint = 0; joint < joints_; ++joint) {
      if (largest_orders_[joint] == 0) continue;
      double* powers = workspace.multiples.data() + joint * stride;
      const double cosine = std::cos(workspace.angles[joint]);
      const double sine = std::sin(workspace.angles[joint]);
      powers[0] = 1.0;
      powers[1] = 0.0;
      for (int order = 1; order <= largest_orders_[joint]; ++order) {
        powers[2 * order] = powers[2 * order - 2] * cosine - powers[2 * order - 1] * sine;
        powers[2 * order + 1] = powers[2 * order - 2] * sine + powers[2 * order - 1] * cosine;
      }
    }
    for (std::size_t number = 0; number < phases_.size(); ++number) {
      const detail::Phase& phase = phases_[number];
      if (orders_[number] > 0) {
        const double* powers = workspace.multiples.data() +
                               static_cast<std::size_t>(phase.front().first) * stride +
                               2 * orders_[number];
        workspace.cosines[number] = powers[0];
        workspace.sines[number] = powers[1];
        continue;
      }
      double angle = 0.0;
      for (const auto& part : phase)
        angle += part.second * workspace.angles[static_cast<std::size_t>(part.first)];
      workspace.cosines[number] = std::cos(angle);
      workspace.sines[number] = std::sin(angle);
    }
    evaluate_factors(terms_, workspace.factors, workspace);
    evaluate_factors(series_, workspace.series_factors, workspace);
    std::fill(workspace.fixed.begin(), workspace.fixed.end(), 0.0);
    std::copy(workspace.angles.begin(), workspace.angles.end(), workspace.fixed.begin());
    for (std::size_t number : terms_.fixed)
      workspace.fixed[static_cast<std::size_t>(terms_.all[number].coordinate)] +=
          workspace.factors[number];
  }

  void evaluate_factors(const detail::Terms& terms, std::vector<double>& factors,
                        const Workspace& workspace) const {
    for (std::size_t number : terms.varying) {
      const detail::Term& term = terms.all[number];
      double factor = term.value;
      if (term.phase >= 0) {
        const auto phase = static_cast<std::size_t>(term.phase);
        factor *= term.sine ? workspace.sines[phase] : workspace.cosines[phase];
      }
      for (int joint : term.angles) factor *= workspace.angles[static_cast<std::size_t>(joint)];
      factors[number] = factor;
    }
  }

  // Follow the chain; store the twists and frames that loads need.
  void walk(Workspace& workspace, bool rigid, bool for_loads = true) const {
    detail::Frame frame;
    for (std::size_t number = 0; number < transforms_.size(); ++number) {
      const detail::Transform& transform = transforms_[number];
      if (for_loads && framed_[number]) workspace.frames[number] = frame;
      if (for_loads && twisted_[number]) {
        const auto k = static_cast<std::size_t>(transform.coordinate);
        const Vector3& axis = frame.axes[static_cast<std::size_t>(transform.axis)];
        const Vector3 direction = detail::scaled(axis, transform.sign);
        detail::Twist& twist = workspace.twists[k];
        twist.linear = transform.turns ? detail::cross(frame.origin, direction) : direction;
        twist.angular = transform.turns ? direction : Vector3{};
      }
      if (!moved_[number]) continue;
      double amount = transform.constant;
      double cosine = transform.cosine;
      double sine = transform.sine;
      if (transform.coordinate >= 0) {
        const auto k = static_cast<std::size_t>(transform.coordinate);
        if (rigid && k >= joints_) continue;
        amount = transform.sign * (rigid ? workspace.angles[k] : workspace.coordinates[k]);
        if (transform.turns) detail::cosine_and_sine(amount, cosine, sine);
      }
      if (transform.turns)
        frame.turn(transform.axis, cosine, sine);
      else
        frame.shift(transform.axis, amount);
    }
    if (framed_.back()) workspace.frames.back() = frame;
    workspace.end = frame;
  }

  // Find the displaced pose; loads act there.
  void come_to_rest(const Wrench& wrench, Workspace& workspace) const {
    for (int iteration = 0; iteration <= iterations_; ++iteration) {
      walk(workspace, iteration == 0);
      evaluate_loads(wrench, workspace);
      displace(workspace, workspace.coordinates);
    }
    walk(workspace, false, false);
  }

  // Displace coordinates by the loads of the last evaluation.
  void displace(Workspace& workspace, std::vector<double>& coordinates) const {
    coordinates = workspace.fixed;
    add_loaded_terms(terms_, workspace.factors, coordinates, workspace);
  }

  // Come near a wanted pose, moved by an aim. The loads follow from the displaced pose, which
  // is nearly known, so that each step adds what they will displace to what it corrects.
  // Predictions evaluate the loads a stated number of times, steps until they no longer
  // change; the aim contains the difference. The last approach ends with an error that is
  // evaluated. Return false if the steps lead nowhere.
  bool approach(const Pose& wanted, const std::array<double, 6>& aim, const Wrench& wrench,
                bool is_last, std::array<double, 6>& error, Workspace& workspace) const {
    for (int step = 0; step < most_steps; ++step) {
      displace(workspace, workspace.coordinates);
      walk(workspace, false);
      error = find_error(wanted, workspace);
      for (std::size_t i = 0; i < 6; ++i) error[i] += aim[i];
      evaluate_loads(wrench, workspace);
      displace(workspace, workspace.displacement);
      subtract_motion(error, workspace);
      const double largest = find_largest(error);
      if (is_last && largest < converged_m) return true;
      compute_jacobian(workspace, workspace.jacobian);
      if (!take_step(error, workspace)) return false;
      if (!is_last && largest < approached_m) return true;
    }
    return false;
  }

  // Wanted less predicted pose at the end of the last walk.
  std::array<double, 6> find_error(const Pose& wanted, const Workspace& workspace) const {
    const Pose reached = get_pose(workspace);
    const Vector3 turn = detail::rotation_vector(wanted.rotation, reached.rotation);
    std::array<double, 6> error{};
    for (std::size_t i = 0; i < 3; ++i) {
      error[i] = wanted.position[i] - reached.position[i];
      error[i + 3] = turn[i];
    }
    return error;
  }

  static double find_largest(const std::array<double, 6>& error) {
    double largest = 0.0;
    for (double component : error) largest = std::max(largest, std::abs(component));
    return largest;
  }

  // Subtract from an error, to first order, the motion of the end effector from the
  // coordinates of the last walk to the displacements.
  void subtract_motion(std::array<double, 6>& error, const Workspace& workspace) const {
    detail::Twist sum;
    for (std::size_t k : moving_) {
      const double amount = workspace.displacement[k] - workspace.coordinates[k];
      const detail::Twist& twist = workspace.twists[k];
      detail::add_scaled(sum.linear, twist.linear, amount);
      detail::add_scaled(sum.angular, twist.angular, amount);
    }
    const Vector3 lever = detail::cross(sum.angular, workspace.end.place(end_offset_));
    for (std::size_t i = 0; i < 3; ++i) {
      error[i] -= sum.linear[i] + lever[i];
      error[i + 3] -= sum.angular[i];
    }
  }

  // First moment of a body about the base's origin.
  static Vector3 first_moment(const detail::Body& body, const Workspace& workspace) {
    const detail::Frame& frame = workspace.frames[static_cast<std::size_t>(body.after)];
    Vector3 sum = detail::scaled(frame.origin, body.mass);
    detail::add_scaled(sum, frame.axes[0], body.moment[0]);
    detail::add_scaled(sum, frame.axes[1], body.moment[1]);
    detail::add_scaled(sum, frame.axes[2], body.moment[2]);
    return sum;
  }

  // Loads on joints by the weights of bodies, by virtual work.
  void evaluate_weights(Workspace& workspace) const {
    if (weights_.empty()) return;
    for (std::size_t joint = 0; joint < joints_; ++joint) {
      const detail::Twist& twist = workspace.twists[joint];
      workspace.sinkings[joint] = detail::dot(twist.linear, gravity_);
      workspace.lowerings[joint] = detail::cross(gravity_, twist.angular);
    }
    double* load = workspace.loads.data() + coordinates_;
    for (const detail::Weight& weight : weights_)
      *load++ = weight.body.mass * workspace.sinkings[weight.joint] +
                detail::dot(first_moment(weight.body, workspace),
                            workspace.lowerings[weight.joint]);
  }

  void evaluate_loads(const Wrench& wrench, Workspace& workspace) const {
    const Vector3 force{wrench[0], wrench[1], wrench[2]};
    const Vector3 moment = detail::cross(workspace.end.origin, force);
    Wrench on_joints{wrench[0],
                     wrench[1],
                     wrench[2],
                     wrench[3] + moment[0],
                     wrench[4] + moment[1],
                     wrench[5] + moment[2]};
    Wrench on_links{};
    auto body = bodies_.begin();
    for (int coordinate : loaded_) {
      const auto k = static_cast<std::size_t>(coordinate);
      for (; body != bodies_.end() && body->after > index_[k]; ++body) {
        const Vector3 couple = detail::cross(first_moment(*body, workspace), gravity_);
        Wrench& sum = body->loads_joints ? on_joints : on_links;
        for (std::size_t i = 0; i < 3; ++i) {
          sum[i] += body->mass * gravity_[i];
          sum[i + 3] += couple[i];
        }
      }
      workspace.loads[k] = workspace.twists[k].power(on_joints);
      if (weighs_links_ && k >= joints_) workspace.loads[k] += workspace.twists[k].power(on_links);
    }
    evaluate_weights(workspace);
  }

  void add_loaded_terms(const detail::Terms& terms, const std::vector<double>& factors,
                        std::vector<double>& displaced, const Workspace& workspace) const {
    for (const detail::LinearTerm& term : terms.linear)
      displaced[term.coordinate] += factors[term.number] * workspace.loads[term.load];
    for (std::size_t number : terms.others) {
      const detail::Term& term = terms.all[number];
      double amount = factors[number];
      for (std::size_t load : term.factors) amount *= workspace.loads[load];
      if (term.limit != detail::Limit::none) {
        const double load = workspace.loads[static_cast<std::size_t>(term.limited)];
        if (term.limit == detail::Limit::tanh)
          amount *= std::tanh(load / term.threshold);
        else
          amount *= std::min(std::max(load, -term.threshold), term.threshold);
      }
      displaced[static_cast<std::size_t>(term.coordinate)] += amount;
    }
  }

  Pose get_pose(const Workspace& workspace) const {
    Pose pose;
    pose.position = workspace.end.place(end_offset_);
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        pose.rotation[row][column] = workspace.end.axes[column][row];
    return pose;
  }

  // Displacement of the end effector by the regression on the residuals, with the loads of
  // the last evaluation.
  Vector3 correct_residual(const Wrench& wrench, Workspace& workspace) const {
    Vector3 moved{};
    if (regression_range_.empty() || !regression_range_.front().contains(workspace.angles, wrench))
      return moved;
    if (!forest_.empty()) return forest_.front().mean(workspace.angles, wrench);
    if (!process_.empty()) return process_.front().mean(workspace.angles, wrench, workspace.scaled);
    std::fill(workspace.displacement.begin(), workspace.displacement.end(), 0.0);
    for (std::size_t number : series_.fixed)
      workspace.displacement[static_cast<std::size_t>(series_.all[number].coordinate)] +=
          workspace.series_factors[number];
    add_loaded_terms(series_, workspace.series_factors, workspace.displacement, workspace);
    const detail::Frame end = workspace.end;
    walk(workspace, true);
    const Vector3 point = workspace.end.place(end_offset_);
    workspace.end = end;
    for (std::size_t number = 0; number < transforms_.size(); ++number) {
      if (!twisted_[number]) continue;
      const auto k = static_cast<std::size_t>(transforms_[number].coordinate);
      const detail::Twist& twist = workspace.twists[k];
      const Vector3 lever = detail::cross(twist.angular, point);
      for (int i = 0; i < 3; ++i)
        moved[i] += workspace.displacement[k] * (twist.linear[i] + lever[i]);
    }
    return moved;
  }

  // Columns of the Jacobian at the pose of the last walk, one for each joint.
  void compute_jacobian(const Workspace& workspace, Jacobian& jacobian) const {
    const Vector3 point = workspace.end.place(end_offset_);
    for (std::size_t joint = 0; joint < joints_; ++joint) {
      const detail::Twist& twist = workspace.twists[joint];
      const Vector3 lever = detail::cross(twist.angular, point);
      for (std::size_t i = 0; i < 3; ++i) {
        jacobian[joint][i] = twist.linear[i] + lever[i];
        jacobian[joint][i + 3] = twist.angular[i];
      }
    }
  }

  // Change the angles by a step that removes an error, to first order. All steps are
  // combinations of the directions of the uncorrected command, so that a robot with more
  // than six joints moves as little as possible away from it.
  bool take_step(const std::array<double, 6>& error, Workspace& workspace) const {
    std::array<std::array<double, 6>, 6> square{};
    for (std::size_t joint = 0; joint < joints_; ++joint)
      for (std::size_t i = 0; i < 6; ++i)
        for (std::size_t j = 0; j < 6; ++j)
          square[i][j] += workspace.jacobian[joint][i] * workspace.directions[joint][j];
    std::array<double, 6> multipliers = error;
    if (!detail::solve6(square, multipliers)) return false;
    for (std::size_t joint = 0; joint < joints_; ++joint)
      for (std::size_t i = 0; i < 6; ++i)
        workspace.angles[joint] += workspace.directions[joint][i] * multipliers[i];
    evaluate_waves(workspace);
    return true;
  }
};

inline Workspace::Workspace(const Model& model)
    : angles(model.joints_),
      fixed(model.coordinates_),
      coordinates(model.coordinates_),
      displacement(model.coordinates_),
      loads(model.coordinates_ + model.weights_.size()),
      factors(model.terms_.values()),
      series_factors(model.series_.values()),
      cosines(model.phases_.size()),
      sines(model.phases_.size()),
      multiples(model.joints_ * 2 * (Model::most_multiples + 1)),
      scaled(model.joints_ + 9),
      twists(model.coordinates_),
      sinkings(model.joints_),
      lowerings(model.joints_),
      frames(model.transforms_.size() + 1),
      directions(model.joints_),
      jacobian(model.joints_) {}

}  // namespace elastocal

#endif  // ELASTOCAL_MODEL_HPP
