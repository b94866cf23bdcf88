// Positions as they are, to be read back: which vertices are copies of others.
#version 430 core

in vec3 in_position;
out vec3 v_position;

void main() {
    v_position = in_position;
}
