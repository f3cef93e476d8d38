"""MAVLink: transports, the vehicle microservices and the companion that uploads missions."""
