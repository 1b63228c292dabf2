// A base of ROS 2 by eProsima Fast DDS, which is another maker's than the link's own DDS.
//
//   base DOMAIN BELOW [stamped] [garbage]
//
// Publishes BELOW/imu (best effort) and BELOW/odom at 200 Hz, hears BELOW/cmd_vel, with the
// qualities of service of rmw's defaults. Prints a line for each command: "twist SEC NANOSEC X Y Z
// X Y Z", the numbers bit by bit, and "stopped" when its time-out of 60 ms has passed. `garbage`:
// others publish beside it, one bytes that are no message, one a frame whose name is no text in
// UTF-8. Ends with its standard input.
#include "basePubSubTypes.h"

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include <poll.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <thread>

using namespace eprosima::fastdds::dds;
namespace geometry = geometry_msgs::msg::dds_;
namespace sensors = sensor_msgs::msg::dds_;
namespace nav = nav_msgs::msg::dds_;
using Clock = std::chrono::steady_clock;
using SerializedPayload = eprosima::fastrtps::rtps::SerializedPayload_t;

// Bytes that are no message, under a message's name.
class Garbage : public TopicDataType {
public:
    Garbage()
    {
        setName("sensor_msgs::msg::dds_::Imu_");
        m_typeSize = 400;
        m_isGetKeyDefined = false;
    }

    bool serialize(void *data, SerializedPayload *payload) override
    {
        const auto &bytes = *static_cast<std::string *>(data);
        payload->length = static_cast<uint32_t>(bytes.size());
        std::memcpy(payload->data, bytes.data(), bytes.size());
        return true;
    }

    bool deserialize(SerializedPayload *, void *) override { return false; }

    std::function<uint32_t()> getSerializedSizeProvider(void *data) override
    {
        return [data] { return static_cast<uint32_t>(static_cast<std::string *>(data)->size()); };
    }

    void *createData() override { return new std::string; }
    void deleteData(void *data) override { delete static_cast<std::string *>(data); }

    bool getKey(void *, eprosima::fastrtps::rtps::InstanceHandle_t *, bool) override
    {
        return false;
    }
};

static DomainParticipant *participant(int domain)
{
    return DomainParticipantFactory::get_instance()->create_participant(
        static_cast<DomainId_t>(domain), PARTICIPANT_QOS_DEFAULT);
}

static DataWriter *
writer(DomainParticipant *who, TopicDataType *type, const std::string &name, bool reliable)
{
    TypeSupport support(type);
    support.register_type(who);
    Topic *topic = who->create_topic("rt" + name, support.get_type_name(), TOPIC_QOS_DEFAULT);
    DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
    qos.reliability().kind = reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
    qos.history().depth = reliable ? 10 : 5;
    return who->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, qos);
}

static void stamp(std_msgs::msg::dds_::Header_ &header)
{
    auto now = std::chrono::system_clock::now().time_since_epoch();
    auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
    header.stamp().sec(static_cast<int32_t>(ns / 1000000000));
    header.stamp().nanosec(static_cast<uint32_t>(ns % 1000000000));
}

static void print(int32_t sec, uint32_t nanosec, const geometry::Twist_ &twist)
{
    const auto &v = twist.linear(), &w = twist.angular();
    std::printf("twist %d %u %a %a %a ", sec, nanosec, v.x(), v.y(), v.z());
    std::printf("%a %a %a\n", w.x(), w.y(), w.z());
}

static bool take(DataReader *commands, bool stamped, geometry::Twist_ &told)
{
    bool heard = false;
    SampleInfo info;
    geometry::TwistStamped_ headed;
    geometry::Twist_ twist;
    void *into = stamped ? static_cast<void *>(&headed) : static_cast<void *>(&twist);
    while (commands->take_next_sample(into, &info) == ReturnCode_t::RETCODE_OK) {
        if (!info.valid_data) continue;
        told = stamped ? headed.twist() : twist;
        print(headed.header().stamp().sec(), headed.header().stamp().nanosec(), told);
        heard = true;
    }
    return heard;
}

int main(int argc, char **argv)
{
    if (argc < 3) return 2;
    const int domain = std::atoi(argv[1]);
    const std::string below = argv[2];
    bool stamped = false, garbage = false;
    for (int k = 3; k < argc; k++) {
        stamped |= !std::strcmp(argv[k], "stamped");
        garbage |= !std::strcmp(argv[k], "garbage");
    }
    DomainParticipant *base = participant(domain);
    if (base == nullptr) return 3;
    DataWriter *imus = writer(base, new sensors::Imu_PubSubType, below + "/imu", false);
    DataWriter *odometry = writer(base, new nav::Odometry_PubSubType, below + "/odom", true);
    TypeSupport type(stamped ? static_cast<TopicDataType *>(new geometry::TwistStamped_PubSubType)
                             : static_cast<TopicDataType *>(new geometry::Twist_PubSubType));
    type.register_type(base);
    Topic *topic =
        base->create_topic("rt" + below + "/cmd_vel", type.get_type_name(), TOPIC_QOS_DEFAULT);
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 300; // ROS has 10; a pause of this machine is to overwrite none
    DataReader *commands =
        base->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, qos);
    DataWriter *noise = nullptr, *no_text = nullptr;
    if (garbage) {
        noise = writer(participant(domain), new Garbage, below + "/imu", false);
        no_text = writer(participant(domain), new sensors::Imu_PubSubType, below + "/imu", false);
    }

    geometry::Twist_ told;
    sensors::Imu_ imu;
    nav::Odometry_ odom;
    imu.header().frame_id("imu_link");
    odom.header().frame_id("odom");
    odom.child_frame_id("base_link");
    imu.orientation_covariance()[0] = -1.0;
    const auto start = Clock::now();
    auto heard_at = start - std::chrono::seconds(1);
    bool moves = false;
    pollfd input{0, POLLIN, 0};
    for (long k = 1; poll(&input, 1, 0) == 0; k++) {
        std::this_thread::sleep_until(start + std::chrono::microseconds(5000 * k));
        if (take(commands, stamped, told)) {
            heard_at = Clock::now();
            moves = true;
        } else if (moves && Clock::now() - heard_at > std::chrono::milliseconds(60)) {
            told = geometry::Twist_();
            moves = false;
            std::printf("stopped\n");
        }
        if (noise != nullptr) {
            std::string bytes("\0\1\0\0", 4);
            for (long n = k % 320; n > 0; n--) bytes.push_back(static_cast<char>(std::rand()));
            noise->write(&bytes);
            sensors::Imu_ named;
            named.header().frame_id("\xff\xfe");
            no_text->write(&named);
        }
        stamp(odom.header());
        odom.twist().twist(told);
        odometry->write(&odom);
        stamp(imu.header());
        imu.angular_velocity().x(0.125);
        imu.angular_velocity().y(-0.25);
        imu.angular_velocity().z(told.angular().z());
        imu.linear_acceleration().x(0.5);
        imu.linear_acceleration().y(-1.5);
        imu.linear_acceleration().z(9.75);
        imus->write(&imu);
        std::fflush(stdout);
    }
    std::fflush(stdout);
    std::_Exit(0); // it may go as a process that is killed does
}
