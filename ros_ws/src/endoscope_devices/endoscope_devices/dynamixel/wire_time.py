"""How much of the line a cycle of the driver takes: the limit of its rate."""

from endoscope_devices.dynamixel.control_table import GOAL_POSITION
from endoscope_devices.dynamixel.packet import STATUS_OVERHEAD
from endoscope_devices.dynamixel.packet_handler import sync_read_request, sync_write_request
from endoscope_devices.dynamixel.serial_port import byte_time
from endoscope_devices.dynamixel.servo_block import BLOCK_ADDRESS, BLOCK_SIZE


def bytes_of_cycle(servos: int) -> int:
    """Bytes of one sync write of goals and one sync read with its answers, unstuffed."""
    devices = range(1, servos + 1)
    goals = {device: bytes(GOAL_POSITION.size) for device in devices}
    requests = sync_write_request(GOAL_POSITION.address, GOAL_POSITION.size, goals)
    requests += sync_read_request(BLOCK_ADDRESS, BLOCK_SIZE, list(devices))
    return len(requests) + servos * (STATUS_OVERHEAD + BLOCK_SIZE)


def cycles_per_second(baud: int, servos: int, return_delay: float = 0.0) -> float:
    """Largest rate that the line carries at `baud` bit/s, with `return_delay` s of each servo."""
    return 1.0 / (bytes_of_cycle(servos) * byte_time(baud) + servos * return_delay)
