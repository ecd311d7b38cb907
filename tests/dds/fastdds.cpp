// Drives the ego with another implementation of DDS, eProsima's Fast DDS: takes the problem instance and the odometry,
// answers every odometry with a Twist, and at the end of the trial prints the instance and the last odometry.
// The types are written here from ROS 2's interface definitions. fastdds DOMAIN
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;
namespace rtps = eprosima::fastrtps::rtps;
using namespace eprosima::fastdds::dds;

struct Twist {
    std::array<double, 6> numbers{};  // linear x y z, angular x y z
    void put(Cdr &cdr) const { cdr << numbers; }
    void take(Cdr &cdr) { cdr >> numbers; }
};

struct Odometry {
    int32_t sec = 0;
    uint32_t nanosec = 0;
    std::string frame, child;
    std::array<double, 7> pose{};  // position x y z, orientation x y z w
    std::array<double, 36> pose_covariance{}, twist_covariance{};
    std::array<double, 6> twist{};
    void put(Cdr &cdr) const { cdr << sec << nanosec << frame << child << pose << pose_covariance << twist << twist_covariance; }
    void take(Cdr &cdr) { cdr >> sec >> nanosec >> frame >> child >> pose >> pose_covariance >> twist >> twist_covariance; }
};

struct Instance {
    std::string json;
    void put(Cdr &cdr) const { cdr << json; }
    void take(Cdr &cdr) { cdr >> json; }
};

template <class T>
class Type : public TopicDataType {
public:
    explicit Type(const char *name) {
        setName(name);
        m_typeSize = 1 << 20;
    }
    bool serialize(void *data, rtps::SerializedPayload_t *payload) override {
        FastBuffer buffer(reinterpret_cast<char *>(payload->data), payload->max_size);
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        payload->encapsulation = cdr.endianness() == Cdr::BIG_ENDIANNESS ? CDR_BE : CDR_LE;
        cdr.serialize_encapsulation();
        static_cast<T *>(data)->put(cdr);
        payload->length = static_cast<uint32_t>(cdr.getSerializedDataLength());
        return true;
    }
    bool deserialize(rtps::SerializedPayload_t *payload, void *data) override {
        FastBuffer buffer(reinterpret_cast<char *>(payload->data), payload->length);
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        cdr.read_encapsulation();
        static_cast<T *>(data)->take(cdr);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void *) override {
        return [this] { return m_typeSize; };
    }
    void *createData() override { return new T; }
    void deleteData(void *data) override { delete static_cast<T *>(data); }
    bool getKey(void *, rtps::InstanceHandle_t *, bool) override { return false; }
};

static DomainParticipant *join(uint32_t domain) {
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    DomainParticipantQos qos;
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    for (uint32_t index = 0; index < 10; ++index) {
        rtps::Locator_t peer;
        rtps::IPLocator::setIPv4(peer, "127.0.0.1");
        peer.port = 7400 + 250 * domain + 10 + 2 * index;  // where participants listen for each other (DDSI-RTPS 9.6.1)
        qos.wire_protocol().builtin.initialPeersList.push_back(peer);
    }
    return DomainParticipantFactory::get_instance()->create_participant(domain, qos);
}

template <class T>
static Topic *topic(DomainParticipant *participant, const char *name, const char *type) {
    TypeSupport support(new Type<T>(type));
    support.register_type(participant);
    return participant->create_topic(name, type, TOPIC_QOS_DEFAULT);
}

int main(int count, char **arguments) {
    if (count != 2) return 2;
    DomainParticipant *participant = join(static_cast<uint32_t>(std::atoi(arguments[1])));
    if (participant == nullptr) return 1;
    Publisher *publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    Subscriber *subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    DataWriterQos writing = DATAWRITER_QOS_DEFAULT;
    writing.reliability().kind = RELIABLE_RELIABILITY_QOS;
    DataReaderQos reading = DATAREADER_QOS_DEFAULT;
    reading.reliability().kind = RELIABLE_RELIABILITY_QOS;
    DataWriter *commands = publisher->create_datawriter(
        topic<Twist>(participant, "rt/ego/mobile_base/commands/velocity", "geometry_msgs::msg::dds_::Twist_"), writing);
    DataReader *odometry = subscriber->create_datareader(
        topic<Odometry>(participant, "rt/ego/odom", "nav_msgs::msg::dds_::Odometry_"), reading);
    reading.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
    DataReader *instances = subscriber->create_datareader(
        topic<Instance>(participant, "rt/dubins_traffic_maestro/probleminstance_JSON", "std_msgs::msg::dds_::String_"),
        reading);

    std::string problem;
    Odometry seen;
    SampleInfo info;
    bool over = false;
    auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!over && std::chrono::steady_clock::now() < until) {
        Instance instance;
        while (instances->take_next_sample(&instance, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            over = instance.json.empty() && !problem.empty();
            if (!instance.json.empty()) problem = instance.json;
        }
        while (odometry->take_next_sample(&seen, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data || problem.empty()) continue;
            Twist command;
            command.numbers[0] = 0.25 + 0.01 * seen.pose[0];
            command.numbers[5] = 0.3 * seen.pose[1];
            commands->write(&command);
        }
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    std::printf("%s\n%s %s %.17g %.17g %.17g %.17g\n", problem.c_str(), seen.frame.c_str(), seen.child.c_str(),
                seen.pose[0], seen.pose[1], seen.twist[0], seen.twist[5]);
    participant->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant);
    return over ? 0 : 1;
}
