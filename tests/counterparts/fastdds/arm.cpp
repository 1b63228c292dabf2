// An arm of ROS 2 by eProsima Fast DDS, which is another maker's than the link's own DDS.
//
//   arm DOMAIN BELOW
//
// Publishes BELOW/joint_states at 200 Hz, of three joints that stand and tell no efforts, and hears
// BELOW/target. Prints a line for each pose: "pose SEC NANOSEC FRAME X Y Z X Y Z W", the numbers bit
// by bit. Ends with its standard input.
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
#include <string>

using namespace eprosima::fastdds::dds;
using PoseStamped = geometry_msgs::msg::dds_::PoseStamped_;
using JointState = sensor_msgs::msg::dds_::JointState_;

static Topic *topic_of(DomainParticipant *who, TopicDataType *type, const std::string &name)
{
    TypeSupport support(type);
    support.register_type(who);
    return who->create_topic("rt" + name, support.get_type_name(), TOPIC_QOS_DEFAULT);
}

static void stamp(std_msgs::msg::dds_::Header_ &header)
{
    auto now = std::chrono::system_clock::now().time_since_epoch();
    auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
    header.stamp().sec(static_cast<int32_t>(ns / 1000000000));
    header.stamp().nanosec(static_cast<uint32_t>(ns % 1000000000));
}

static void print(const PoseStamped &told)
{
    const auto &header = told.header();
    const auto &p = told.pose().position();
    const auto &q = told.pose().orientation();
    std::printf("pose %d %u %s ", header.stamp().sec(), header.stamp().nanosec(),
                header.frame_id().c_str());
    std::printf("%a %a %a %a %a %a %a\n", p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w());
}

int main(int argc, char **argv)
{
    if (argc < 3) return 2;
    const std::string below = argv[2];
    DomainParticipant *arm = DomainParticipantFactory::get_instance()->create_participant(
        static_cast<DomainId_t>(std::atoi(argv[1])), PARTICIPANT_QOS_DEFAULT);
    if (arm == nullptr) return 3;
    using namespace sensor_msgs::msg::dds_;
    using namespace geometry_msgs::msg::dds_;
    Topic *joints = topic_of(arm, new JointState_PubSubType, below + "/joint_states");
    Topic *target = topic_of(arm, new PoseStamped_PubSubType, below + "/target");
    DataWriter *states =
        arm->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(joints, DATAWRITER_QOS_DEFAULT);
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 1000;
    DataReader *commands =
        arm->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(target, qos);
    JointState says;
    says.header().frame_id("base_link");
    says.name({"gripper", "lift", "turn"});
    says.position({0.125, -0.5, 1.75});
    says.velocity({0.0, 0.25, -1.5});
    pollfd in{0, POLLIN, 0};
    while (poll(&in, 1, 5) == 0) {
        stamp(says.header());
        states->write(&says);
        SampleInfo info;
        PoseStamped told;
        while (commands->take_next_sample(&told, &info) == ReturnCode_t::RETCODE_OK) {
            if (info.valid_data) print(told);
        }
        std::fflush(stdout);
    }
    return 0;
}
