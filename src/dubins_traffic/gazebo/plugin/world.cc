// The world plugin of dubins-traffic for Gazebo 11: steps the physics when it is told to, and only then.
//
// It holds the physics thread at the beginning of an iteration until the other end of its socket asks for steps,
// and answers with the state after the last of them. docs/gazebo-plugin.md describes the messages.

#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gazebo/common/Events.hh>
#include <gazebo/common/Plugin.hh>
#include <gazebo/ode/ode.h>
#include <gazebo/physics/ode/ODECollision.hh>
#include <gazebo/physics/physics.hh>

#ifndef DUBINS_TRAFFIC_PROTOCOL
#error "the protocol's version is given by the build"
#endif

namespace dubins_traffic {

using Vector = ignition::math::Vector3d;

enum Kind : std::uint32_t { HELLO = 1, STEP = 2, STATE = 3, PLACE = 4, SCAN = 5, QUIT = 6, REFUSED = 0xffffffff };

const char *const SOCKET = "DUBINS_TRAFFIC_GAZEBO_SOCKET";
const std::chrono::microseconds LINGER(60);
const int MOST = 4;                       // points of contact of two hulls
const std::uint32_t LONGEST = 1u << 20;  // numbers in a message

// Numbers over a socket: kind, count, count doubles, all in this machine's byte order.
class Line {
 public:
  explicit Line(int file) : file_(file) {}

  bool Get(std::uint32_t &kind, std::vector<double> &numbers) {
    std::uint32_t head[2];
    Linger();
    if (!Read(head, sizeof head) || head[1] > LONGEST) return false;
    kind = head[0];
    numbers.resize(head[1]);
    return Read(numbers.data(), numbers.size() * sizeof(double));
  }

  bool Put(std::uint32_t kind, const std::vector<double> &numbers) {
    const std::uint32_t head[2] = {kind, static_cast<std::uint32_t>(numbers.size())};
    out_.assign(reinterpret_cast<const char *>(head), sizeof head);
    out_.append(reinterpret_cast<const char *>(numbers.data()), numbers.size() * sizeof(double));
    std::size_t done = 0;
    while (done < out_.size()) {
      const ssize_t sent = write(file_, out_.data() + done, out_.size() - done);
      if (sent <= 0) return false;
      done += static_cast<std::size_t>(sent);
    }
    return true;
  }

 private:
  // The next question often comes at once, and to wake up from sleep takes longer than to look for it.
  void Linger() const {
    const auto until = std::chrono::steady_clock::now() + LINGER;
    char first;
    while (recv(file_, &first, 1, MSG_DONTWAIT | MSG_PEEK) < 0 && std::chrono::steady_clock::now() < until) {
    }
  }

  bool Read(void *into, std::size_t size) {
    char *at = static_cast<char *>(into);
    while (size > 0) {
      const ssize_t got = read(file_, at, size);
      if (got <= 0) return false;
      at += got;
      size -= static_cast<std::size_t>(got);
    }
    return true;
  }

  int file_;
  std::string out_;
};

struct Car {
  gazebo::physics::ModelPtr model;
  gazebo::physics::LinkPtr base;
  gazebo::physics::JointPtr wheels[2];
};

struct Hull {
  dGeomID shape;
  int body;  // of a car its number, of obstacle k -1 - k
  dReal box[6];
};

class World : public gazebo::WorldPlugin {
 public:
  void Load(gazebo::physics::WorldPtr world, sdf::ElementPtr sdf) override {
    const char *socket = std::getenv(SOCKET);
    if (socket == nullptr) {
      gzerr << "dubins-traffic: " << SOCKET << " does not name a socket\n";
      _exit(3);
    }
    line_.reset(new Line(std::atoi(socket)));
    world_ = world;
    torque_ = sdf->Get<double>("torque");
    for (auto each = sdf->GetElement("car"); each; each = each->GetNextElement("car")) AddCar(each->Get<std::string>());
    if (sdf->HasElement("obstacle"))
      for (auto each = sdf->GetElement("obstacle"); each; each = each->GetNextElement("obstacle"))
        AddObstacle(each->Get<std::string>());
    begin_ = gazebo::event::Events::ConnectWorldUpdateBegin(std::bind(&World::Begin, this));
    before_ = gazebo::event::Events::ConnectBeforePhysicsUpdate(std::bind(&World::Collided, this));
    end_ = gazebo::event::Events::ConnectWorldUpdateEnd(std::bind(&World::End, this));
  }

 private:
  void AddCar(const std::string &name) {
    Car car;
    car.model = Model(name);
    car.base = car.model->GetLink("base");
    car.wheels[0] = car.model->GetJoint("left_wheel_joint");
    car.wheels[1] = car.model->GetJoint("right_wheel_joint");
    for (auto &wheel : car.wheels) wheel->SetParam("fmax", 0, torque_);
    AddHull(car.base->GetCollision("hull"), static_cast<int>(cars_.size()));
    cars_.push_back(car);
  }

  void AddObstacle(const std::string &name) {
    --obstacle_;
    for (const auto &link : Model(name)->GetLinks())
      for (const auto &collision : link->GetCollisions()) AddHull(collision, obstacle_);
  }

  void AddHull(const gazebo::physics::CollisionPtr &collision, int body) {
    hulls_.push_back({boost::dynamic_pointer_cast<gazebo::physics::ODECollision>(collision)->GetCollisionId(), body, {}});
  }

  gazebo::physics::ModelPtr Model(const std::string &name) {
    auto model = world_->ModelByName(name);
    if (!model) {
      gzerr << "dubins-traffic: the world has no model " << name << "\n";
      _exit(3);
    }
    return model;
  }

  // Nothing but the other end tells this server to live: when it is gone, so is the server.
  void Begin() {
    while (left_ == 0) {
      if (!line_->Get(kind_, in_) || kind_ == QUIT) _exit(0);
      out_.clear();
      const bool well = Serve();
      if (left_ == 0 && !line_->Put(well ? kind_ : REFUSED, out_)) _exit(0);
    }
  }

  bool Serve() {
    switch (kind_) {
      case HELLO:
        out_ = {static_cast<double>(DUBINS_TRAFFIC_PROTOCOL), static_cast<double>(cars_.size()),
                static_cast<double>(-obstacle_), world_->Physics()->GetMaxStepSize()};
        return true;
      case STEP:
        return Command();
      case STATE:
        Report();
        return true;
      case PLACE:
        return Place();
      case SCAN:
        return Scan();
      default:
        return false;
    }
  }

  bool Command() {
    if (in_.size() != 1 + 2 * cars_.size() || !(in_[0] >= 1 && in_[0] <= 1e6)) return false;
    for (std::size_t n = 0; n < cars_.size(); ++n)
      for (int side = 0; side < 2; ++side) cars_[n].wheels[side]->SetParam("vel", 0, in_[1 + 2 * n + side]);
    left_ = static_cast<int>(in_[0]);
    step_ = 0;
    contacts_.clear();
    met_.clear();
    return true;
  }

  bool Place() {
    if (in_.size() != 4 * cars_.size()) return false;
    for (std::size_t n = 0; n < cars_.size(); ++n) {
      const double *row = &in_[4 * n];
      Car &car = cars_[n];
      car.model->SetWorldPose(ignition::math::Pose3d(row[0], row[1], 0, 0, 0, std::atan2(row[3], row[2])));
      car.model->ResetPhysicsStates();
    }
    Report();
    return true;
  }

  // Called between the search for collisions and the solution of the step: velocities are still those before impact.
  // The engine is asked about the hulls that are near each other; to have it write down all contacts takes longer.
  void Collided() {
    if (left_ == 0) return;
    for (auto &hull : hulls_) dGeomGetAABB(hull.shape, hull.box);
    for (std::size_t i = 0; i < cars_.size(); ++i)
      for (std::size_t j = i + 1; j < hulls_.size(); ++j)
        if (Near(hulls_[i].box, hulls_[j].box)) Note(hulls_[i], hulls_[j]);
  }

  static bool Near(const dReal *one, const dReal *two) {
    return one[0] <= two[1] && two[0] <= one[1] && one[2] <= two[3] && two[2] <= one[3];
  }

  void Note(const Hull &one, const Hull &two) {
    dContactGeom found[MOST];
    const int count = dCollide(one.shape, two.shape, MOST, found, sizeof(dContactGeom));
    if (count < 1 || !met_.insert({one.body, two.body}).second) return;
    double x = 0, y = 0, nx = 0, ny = 0;  // the engine's normal points into the first body
    for (int k = 0; k < count; ++k) {
      x += found[k].pos[0] / count;
      y += found[k].pos[1] / count;
      nx -= found[k].normal[0];
      ny -= found[k].normal[1];
    }
    const double length = std::hypot(nx, ny);
    contacts_.insert(contacts_.end(), {static_cast<double>(step_), static_cast<double>(one.body),
                                       static_cast<double>(two.body), x, y, nx / length, ny / length});
    AddPose(contacts_, one.body);
    AddPose(contacts_, two.body);
  }

  void End() {
    if (left_ == 0) return;
    ++step_;
    if (--left_ > 0) return;
    out_.clear();
    Report();
    out_.insert(out_.end(), contacts_.begin(), contacts_.end());
    if (!line_->Put(STEP, out_)) _exit(0);
  }

  void Report() {
    for (std::size_t n = 0; n < cars_.size(); ++n) AddPose(out_, static_cast<int>(n));
  }

  // x, y, cos, sin of the heading; velocity along x and y; yaw rate. An obstacle has zeros.
  void AddPose(std::vector<double> &numbers, int body) const {
    if (body < 0) {
      numbers.insert(numbers.end(), 7, 0.0);
      return;
    }
    const auto &base = cars_[static_cast<std::size_t>(body)].base;
    const auto pose = base->WorldPose();
    const Vector ahead = pose.Rot().RotateVector(Vector::UnitX), velocity = base->WorldLinearVel();
    const double length = std::hypot(ahead.X(), ahead.Y());
    numbers.insert(numbers.end(), {pose.Pos().X(), pose.Pos().Y(), ahead.X() / length, ahead.Y() / length, velocity.X(),
                                   velocity.Y(), base->WorldAngularVel().Z()});
  }

  // car, height, longest range, then cos and sin of each ray in the car's frame; answers ranges, the longest where free.
  bool Scan() {
    if (in_.size() < 3 || in_.size() % 2 == 0 || !(in_[0] >= 0 && in_[0] < cars_.size())) return false;
    const Car &car = cars_[static_cast<std::size_t>(in_[0])];
    const auto pose = car.base->WorldPose();
    const double longest = in_[2];
    if (!ray_) {
      ray_ = boost::dynamic_pointer_cast<gazebo::physics::RayShape>(
          world_->Physics()->CreateShape("ray", gazebo::physics::CollisionPtr()));
    }
    Show(car, false);
    const Vector from(pose.Pos().X(), pose.Pos().Y(), in_[1]);
    const double yaw = pose.Rot().Yaw(), c = std::cos(yaw), s = std::sin(yaw);
    for (std::size_t k = 3; k + 1 < in_.size(); k += 2) {
      const Vector along(in_[k] * c - in_[k + 1] * s, in_[k] * s + in_[k + 1] * c, 0);
      double range = longest;
      std::string hit;
      ray_->SetPoints(from, from + along * longest);
      ray_->GetIntersection(range, hit);
      out_.push_back(hit.empty() ? longest : range);
    }
    Show(car, true);
    return true;
  }

  // A laser does not see the car that carries it.
  static void Show(const Car &car, bool shown) {
    for (const auto &link : car.model->GetLinks())
      for (const auto &collision : link->GetCollisions()) {
        const auto own = boost::dynamic_pointer_cast<gazebo::physics::ODECollision>(collision);
        if (shown)
          dGeomEnable(own->GetCollisionId());
        else
          dGeomDisable(own->GetCollisionId());
      }
  }

  gazebo::physics::WorldPtr world_;
  gazebo::physics::RayShapePtr ray_;
  gazebo::event::ConnectionPtr begin_, before_, end_;
  std::unique_ptr<Line> line_;
  std::vector<Car> cars_;
  std::vector<Hull> hulls_;  // those of the cars, in their order, then those of obstacles
  std::set<std::pair<int, int>> met_;        // in the steps that are running
  std::vector<double> in_, out_, contacts_;
  std::uint32_t kind_ = 0;
  double torque_ = 0;
  int obstacle_ = 0, left_ = 0, step_ = 0;
};

}  // namespace dubins_traffic

using DubinsTrafficWorld = dubins_traffic::World;
GZ_REGISTER_WORLD_PLUGIN(DubinsTrafficWorld)
